"""The mass matrix of a closed robot: composite inertias of modules, one walk to the root for each module.

The composite inertia of an output is its own and that of all modules on it, their motions held. With a_o,
Psi and X of the direct model (`dynamics/direct_recursion.py`) and D, A of the legs (Eqs. (63)-(75)):

    M_kk = Psi^T A Psi + sum_o a_o^T Ic_o a_o                      Eq. (43) with composite inertias
    F_k  = Psi^T D + sum_o a_o^T Ic_o X_o                          Eq. (42): the base wrench, transposed
    M_kj = F a_o of every module j below, and F <- F X_o           Featherstone's CRBA, module by module
    Ic   of the base += S1 + sum_o X_o^T Ic_o X_o
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from ...effects.choice import Choice, Effects, choose
from ...spatial import Array, motion_matrix
from ...structure.module import ModuleState
from ...structure.robot import HybridRobot
from ...structure.samples import as_positions
from ..inertia_solve import congruence
from ..loads import Loads
from ..passive import needs_inertia
from .coordinates import Coordinates, independent_coordinates
from .independent import ModuleMotions, independent_motions
from .states import closed_states


def mass_matrix(
    robot: HybridRobot, q: ArrayLike, *, joints: Sequence[str] | None = None, effects: Choice = None
) -> Array:
    """Compute the mass matrix M(q) of tau = M u_dot + c + g; the kinetic energy is u^T M u / 2.

    The cost is linear in the number of modules times their depth. For a chain of modules this is quadratic,
    like the number of entries.

    Args:
        robot: The robot.
        q: Positions of the spanning tree, shape (nq,) or (T, nq).
        joints: Independent joints u, in each module as many as its degrees of freedom; the motors by default.
            The twist of a floating base comes first in u.
        effects: As in `idm`; rotors contribute if "rotor_inertia" is among these effects.

    Returns:
        Symmetric matrix, shape (N, N) or (T, N, N), [kg, kg m, kg m^2].

    Raises:
        AssemblyError: The posture does not close the loops.
        SingularityError: Closures lose rank, or the joints are not independent.
        ModelError: Effects are unknown, lack parameters, or do not include "inertia".
        TrajectoryError: An array has the wrong shape or is not finite, or a joint cannot be a coordinate.
    """
    u, on = independent_coordinates(robot, joints), choose(robot, effects)
    needs_inertia(on)
    q, single = as_positions(robot, q)
    states = closed_states(robot, q)
    motions = independent_motions(states, q, None, u)
    M = composite_inertia(robot, states, motions, u, on, len(q))
    return M[0] if single else M


def composite_inertia(
    robot: HybridRobot,
    states: list[ModuleState],
    motions: list[ModuleMotions],
    u: Coordinates,
    on: Effects,
    T: int,
) -> Array:
    """Run the recursion of composite inertias, from the outermost modules inwards, shape (T, N, N)."""
    loads = Loads([], np.zeros((T, 6)), on, None, on.rotor_diagonal(robot))
    Ic = [np.tile(s.mechanism.inertias, (T, 1, 1, 1)) for s in states]
    outputs = [output_maps(s, found) for s, found in zip(states, motions, strict=True)]
    M = np.zeros((T, u.size, u.size))
    for k in reversed(range(len(states))):
        s, Psi, own = states[k], motions[k].basis.Psi, u.own[k]
        legs = loads.leg_matrix(s)
        H = congruence(Psi, legs[:, 6:, 6:])
        F = np.matmul(np.swapaxes(Psi, 1, 2), legs[:, 6:, :6])
        for o, (a_map, X) in enumerate(outputs[k]):
            carried = np.matmul(np.swapaxes(a_map, 1, 2), Ic[k][:, o])
            H, F = H + np.matmul(carried, a_map), F + np.matmul(carried, X)
        M[:, own[:, None], own] = (H + np.swapaxes(H, 1, 2)) / 2
        j, o = s.module.parent, s.module.parent_output
        if j >= 0:
            Ic[j][:, o] += legs[:, :6, :6] + sum(
                congruence(X, Ic[k][:, i]) for i, (_, X) in enumerate(outputs[k])
            )
        while j >= 0:
            a_map, X = outputs[j][o]
            block, below = np.matmul(F, a_map), u.own[j]
            M[:, own[:, None], below] = block
            M[:, below[:, None], own] = np.swapaxes(block, 1, 2)
            F = np.matmul(F, X)
            j, o = states[j].module.parent, states[j].module.parent_output
    return M


def output_maps(s: ModuleState, motions: ModuleMotions) -> list[tuple[Array, Array]]:
    """Compute a_o, shape (T, 6, m), and X_o, shape (T, 6, 6), of every output of a module, own frames."""
    out = []
    for o, body in enumerate(s.mechanism.spec.outputs):
        J = s.mechanism.jacobian(s.motion, body)
        out.append((np.matmul(J, motions.basis.Psi), motion_matrix(*s.placement(o))))
    return out
