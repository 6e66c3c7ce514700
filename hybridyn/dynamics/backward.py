"""Backward sweep of the inverse model: compute forces, efforts and reactions, the outermost modules first."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from ..effects.choice import Effects
from ..linkage.reduction import Basis
from ..spatial import Array, spatial_inertia
from ..structure.module import ModuleState
from ..structure.robot import HybridRobot
from .actuation import Need, Sharing, motor_efforts
from .forward import base_motion, forward
from .guards import (
    EFFORT_DIGITS,
    EPS,
    LOST_PIVOT,
    NEAR_LOST_PIVOT,
    NOISE,
    check,
    check_closure_rank,
    check_digits,
    check_mode,
)
from .inverse_recursion import ModuleForces, needed_forces
from .loads import Loads, all_loads
from .possible_motions import along_motion, possible_motions
from .state_checks import check_closed, natural_force, robot_mass

if TYPE_CHECKING:  # most calls want no reactions
    from .reactions import Reactions


@dataclass(eq=False)
class MotionOfModules:
    """The motion of a robot's modules, of which each has its basis computed once.

    Attributes:
        states: States of the modules.
        v, a: Rates and accelerations, shapes (T, nv), (T, nv).
        residual: Closure residuals, shape (T,).
        strict: Whether closures that lose rank are an error.
    """

    states: list[ModuleState]
    v: Array
    a: Array
    residual: Array
    strict: bool
    _bases: dict[int, Basis] = field(default_factory=dict)

    def motions(self, k: int) -> Basis:
        """Return the motions of module k.

        Raises:
            SingularityError: As `module_motions`.
        """
        if k not in self._bases:
            self._bases[k] = module_motions(self.states[k], self.strict)
        return self._bases[k]


def backward(
    robot: HybridRobot, motion: MotionOfModules, loads: Loads, sharing: Sharing | None, tau: Array,
    result: Reactions | None, q: Array,
) -> None:  # fmt: skip
    """Compute the forces that every module needs, the efforts of its motors and the wrench on its base.

    Args:
        motion, loads: The motion of its modules; external wrenches and effects.
        sharing: How the load is distributed among motors, or None if efforts are known and not checked.
        tau: Efforts, shape (T, motors); filled in place, or read if `sharing` is None.
        result: Reactions, filled in place, or None.
        q: Positions, shape (T, nq).

    Raises:
        SingularityError: Closures lose rank and `on_singular` is "raise"; or a velocity belongs to no branch;
            or the efforts have no correct digit, or the motors lose a direction.
        ActuationError: A passive motion would need an effort.
    """
    states, v, a = motion.states, motion.v, motion.a
    weight = robot_mass(robot) * float(np.linalg.norm(robot.gravity))
    rounding = NOISE * robot.nv * natural_force(robot, v, a)  # one term for each freedom
    sizes = [np.zeros((len(q), len(s.module.outputs))) for s in states]
    root = np.zeros((len(q), 6))
    for k, needed in needed_forces(states, loads, motion.motions):
        s, module = states[k], states[k].module
        if sharing is not None:
            size = _largest_term(s, needed, sizes[k])
            if module.parent >= 0:
                sizes[module.parent][:, module.parent_output] += size
            _check_effort_digits(s, needed, size, weight * s.mechanism.length)
            tau[:, module.motor_index] = efforts_along(  # Eq. (33)
                robot, s, needed.basis, needed.H, size, rounding, sharing
            )  # fmt: skip
        if result is not None:
            from .reactions import module_reactions  # which most calls want none of

            efforts = tau[:, module.motor_index]
            module_reactions(result, s, loads.modules[k], loads.on, needed, efforts)  # Eq. (52)
        if module.parent < 0:
            root += needed.F
    if result is not None:
        result.base[:] = root
        if robot.base != "floating":  # else the root body belongs to a module
            result.base[:] += _of_root_body(robot, loads, q, v, a)


def _of_root_body(robot: HybridRobot, loads: Loads, q: Array, v: Array, a: Array) -> Array:
    """Compute the wrench that the root body itself needs, without the modules on it, shape (T, 6)."""
    V, V_dot = base_motion(robot, q, v, a, loads.on.gravity, classical=loads.on.velocity is not None)
    body = robot.bodies.bodies[0]
    I0 = spatial_inertia(body.mass, body.com, body.inertia)
    return V_dot @ I0 + loads.on.body_bias(V, I0) - loads.root


def reactions_of(robot: HybridRobot, q: Array, v: Array, a: Array, tau: Array, loads: Loads) -> Reactions:
    """Compute the wrenches between modules and in the closures from a motion and known efforts.

    Args:
        q: Positions, shape (T, nq).
        v: Rates, shape (T, nv).
        a: Accelerations, shape (T, nv).
        tau: Efforts of the motors, shape (T, motors).
        loads: External wrenches and effects.
    """
    from .reactions import Reactions  # which most calls want none of

    result, on = Reactions(np.zeros((len(q), 6))), loads.on
    states = forward(robot, q, v, a, on.gravity, classical=on.velocity is not None)
    backward(
        robot, MotionOfModules(states, v, a, np.zeros(len(q)), strict=False), loads, None, tau, result, q
    )
    return result


def unbalanced(
    robot: HybridRobot, on: Effects, q: Array, v: Array, a: Array, tau: Array
) -> Array:  # fmt: skip
    """Compute the largest force that efforts leave along a motion of a module, as a part of its largest term.

    Of accelerations that solve the equations of motion it is rounding, however little inertia a motion has.

    Args:
        q: Positions, shape (T, nq).
        v: Rates, shape (T, nv).
        a: Accelerations, shape (T, nv).
        tau: Efforts of the motors, shape (T, motors).

    Returns:
        Shape (T,), without unit.

    Raises:
        AssemblyError: The motion does not close the loops.
        SingularityError: Closures lose rank.
    """
    loads = all_loads(robot, on, q, v, None, None)
    states = forward(robot, q, v, a, on.gravity, classical=on.velocity is not None)
    check_closed(robot, states, q, v, a)
    sizes = [np.zeros((len(q), len(s.module.outputs))) for s in states]
    worst = np.zeros(len(q))
    for k, needed in needed_forces(states, loads, lambda k: module_motions(states[k], True)):
        module, unit = states[k].module, states[k].mechanism.reduction.col_scale
        columns, efforts = module.motor_columns, tau[:, module.motor_index]
        size = _largest_term(states[k], needed, sizes[k])
        if module.parent >= 0:
            sizes[module.parent][:, module.parent_output] += size
        size = size + np.abs(efforts * unit[columns]).max(axis=1, initial=0.0)
        left = needed.Q - np.einsum("tij,ti->tj", needed.basis.Psi[:, columns], efforts)
        left = np.abs(left).max(axis=1, initial=0.0)
        worst = np.maximum(worst, left / np.where(size > 0, size, 1.0))
    return worst


def module_motions(s: ModuleState, strict: bool) -> Basis:
    """Compute the motions of a module; if its closures lose rank, those of the branch of its velocity.

    Raises:
        SingularityError: Closures lose rank and this is `strict`, or have more than the module, or a velocity
            belongs to no branch.
    """
    basis = s.mechanism.basis(s.K)
    (check_closure_rank if strict else check_mode)(s.module, basis)
    return along_motion(s, basis)


def efforts_along(
    robot: HybridRobot, s: ModuleState, basis: Basis, H: Array, size: Array, rounding: Array, sharing: Sharing
) -> Array:
    """Compute the efforts of a module's motors, shape (T, motors of the module), [N or N m].

    Args:
        s: State of the module.
        basis: Its motions.
        H: Generalised force that its motion needs along x, shape (T, n).
        size: Largest term in the sum Q, shape (T,), [N m].
        rounding: Rounding that may remain in Q if all terms cancel, shape (T,), [N m].
        sharing: How the load is distributed among motors.
    """
    module, Q = s.module, np.einsum("tij,ti->tj", basis.Psi, H)
    tau = motor_efforts(robot, module, Need(basis.Psi, Q, size, rounding, s.motion), sharing)
    for t in np.flatnonzero(basis.pivot < LOST_PIVOT) if s.mechanism.reduction.rank else ():
        # The branch is unknown, so the motors must balance the forces along all possible motions.
        at = slice(t, t + 1)
        every = possible_motions(module, s.K[t])[None]
        Q = np.einsum("tij,ti->tj", every, H[at])
        need = Need(every, Q, size[at], rounding[at], s.motion.take(np.array([t])))
        tau[t] = motor_efforts(robot, module, need, sharing)[0]
    return tau


def _largest_term(s: ModuleState, needed: ModuleForces, on_outputs: Array) -> Array:
    """Compute the largest term in the sum Q of a module, shape (T,), [N m].

    Args:
        on_outputs: Summed sizes of the modules on each output, shape (T, outputs), [N m].
    """
    unit, length = s.mechanism.reduction.col_scale, s.mechanism.length
    size: Array = np.abs(needed.legs * unit).max(axis=1, initial=0.0) + on_outputs.sum(axis=1)
    for W in (needed.F_p, needed.F_e) if s.module.outputs else ():
        forces, moments = (np.sqrt(np.square(part).sum(axis=2)) for part in (W[..., :3], W[..., 3:]))
        size += (forces * length + moments).sum(axis=1)
    return size


def _check_effort_digits(s: ModuleState, needed: ModuleForces, size: Array, weight: float) -> None:
    """Raise if efforts have no correct digit next to a constraint singularity; warn elsewhere.

    A motion that is not smooth next to a singularity has accelerations proportional to 1 / pivot and closure
    wrenches proportional to 1 / pivot^2. The efforts are the small difference of these large terms.

    Args:
        size: Largest term in the sum Q, shape (T,), [N m].
        weight: Largest effort that the robot's weight can cause [N m]; rounding below it is harmless.

    Raises:
        SingularityError: The message names module, sample and condition number.
    """
    if not s.module.motors:
        return
    left, pivot = np.abs(needed.Q).max(axis=1, initial=0.0), needed.basis.pivot
    near = (pivot >= LOST_PIVOT) & (pivot < NEAR_LOST_PIVOT)
    check(
        EFFORT_DIGITS, s.module, np.where(near, EPS * size, 0.0), np.maximum(left, weight) * pivot,
        lambda t: {"what": "closures", "condition": 1 / float(pivot[t]), "size": size[t]},
    )  # fmt: skip
    check_digits(s.module, "efforts", "N m", left, size, weight)
