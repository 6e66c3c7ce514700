"""Equations (30)-(33) of the inverse model: compute the forces that the motion of each module needs.

`backward` checks the results, and `actuation` distributes Q among the motors.
"""

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
        F_p: Wrench that each output needs for its own motion, shape (T, outputs, 6), output frames.
        F_e: Wrench of the loads on each output, shape (T, outputs, 6), output frames: minus the paper's F_e.
        W: Wrench that each output needs from its own module, shape (T, outputs, 6), output frames.
    """

    basis: Basis
    H: Array
    Q: Array
    F: Array
    legs: Array
    F_p: Array
    F_e: Array
    W: Array


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
    inertias, J = s.mechanism.inertias, output_jacobians(s)
    F_b, H_legs = loads.on.leg_forces(s)  # Eqs. (54)-(62)
    f_base, f_legs = loads.on_legs(k, s)
    legs = H_legs - f_legs + loads.rotor_diagonal(s) * s.a
    F_p = np.einsum("toi,oij->toj", s.outputs_dot, inertias)
    F_p += loads.on.body_bias(s.outputs, inertias)  # Eq. (30)
    F_e = loads.modules[k].on_outputs(s)
    W = F_p - F_e + received  # Eqs. (31), (32)
    H = legs + np.einsum("toij,toi->tj", J, W)
    Q = np.einsum("tij,ti->tj", basis.Psi, H)  # Eqs. (16), (17), (33) before the motors
    F = F_b - f_base + wrench_to_base(*s.placements, W).sum(axis=1)  # Eq. (32)
    return ModuleForces(basis, H, Q, F, legs, F_p, F_e, W)


def output_jacobians(s: ModuleState) -> Array:
    """Compute the Jacobians of a module's outputs, from x_dot to their twists, shape (T, outputs, 6, n)."""
    m = s.mechanism
    out = np.zeros((len(s.V), len(m.spec.outputs), 6, m.tree.nv))
    for o, body in enumerate(m.spec.outputs):
        out[:, o] = m.jacobian(s.motion, body)
    return out
