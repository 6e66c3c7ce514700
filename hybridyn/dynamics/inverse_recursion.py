"""Equations (30)-(33) of the inverse model: compute the forces that the motion of each module needs.

`backward` checks the results, and `actuation` distributes Q among the motors.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from ..linkage.reduction import Basis
from ..spatial import Array, wrench_to_base
from ..structure.module import ModuleState
from .loads import Loads


@dataclass(eq=False)
class ModuleForces:
    """Forces that the motion of one module needs.

    Attributes:
        basis: Motions of the module.
        H: Generalised force along x, shape (T, n): that of the legs plus that of the outputs.
        Q: Generalised force along each motion, shape (T, N), [N m].
        F: Wrench of the base on the module, shape (T, 6), base frame: the paper's F_k plus that of the legs.
        legs: Part of H that the legs need, shape (T, n).
        F_p: Wrench that each output needs for its own motion, shape (T, 6), output frame.
        F_e: Wrench of the loads on each output, shape (T, 6), output frame: minus the paper's F_e.
    """

    basis: Basis
    H: Array
    Q: Array
    F: Array
    legs: Array
    F_p: list[Array]
    F_e: list[Array]


def needed_forces(
    states: list[ModuleState], loads: Loads, motions: Callable[[int], Basis]
) -> Iterator[tuple[int, ModuleForces]]:
    """Yield the forces that the motion of every module needs, with its number, the outermost modules first.

    Args:
        states: States of the robot's modules.
        loads: External wrenches and effects.
        motions: Computes the motions of a module from its number.
    """
    received = [np.zeros((len(s.V), len(s.module.outputs), 6)) for s in states]
    for k in reversed(range(len(states))):
        needed = module_forces(states[k], loads, k, motions(k), received[k])
        yield k, needed
        if (below := states[k].module.parent) >= 0:
            received[below][:, states[k].module.parent_output] += needed.F


def module_forces(s: ModuleState, loads: Loads, k: int, basis: Basis, received: Array) -> ModuleForces:
    """Compute the forces that the motion of module k needs.

    Args:
        s: State of the module.
        loads: External wrenches and effects.
        k: Number of the module.
        basis: Motions of the module.
        received: Sum of F_k of the modules on each output, shape (T, outputs, 6), output frame.
    """
    m = s.mechanism
    F_b, H = loads.on.leg_forces(s)  # Eqs. (54)-(62)
    f_base, f_legs = loads.on_legs(k, s)
    F, H = F_b - f_base, H - f_legs + loads.rotor_diagonal(s) * s.a
    out = ModuleForces(basis, H, np.einsum("tij,ti->tj", basis.Psi, H), F, H, [], [])
    for o, body in enumerate(m.spec.outputs):
        inertia, V = m.inertias[o], s.outputs[:, o]
        F_p = s.outputs_dot[:, o] @ inertia + loads.on.body_bias(V, inertia)  # Eq. (30)
        F_e = loads.modules[k].on_output(s, o)
        W = F_p - F_e + received[:, o]  # Eqs. (31), (32)
        J = m.jacobian(s.motion, body)
        out.H = out.H + np.einsum("tij,ti->tj", J, W)
        out.Q += np.einsum("tij,ti->tj", np.matmul(J, basis.Psi), W)  # Eqs. (16), (33) before the motors
        out.F += wrench_to_base(*s.placement(o), W)  # Eq. (32)
        out.F_p.append(F_p)
        out.F_e.append(F_e)
    return out
