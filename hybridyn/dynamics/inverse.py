"""Inverse dynamic model: motor efforts from a motion, Eqs. (30)-(33) in their general form."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, overload

import numpy as np
from numpy.typing import ArrayLike

from ..effects.choice import Choice, choose, times
from ..errors import ActuationError, TrajectoryError
from ..spatial import Array
from ..structure.robot import HybridRobot
from ..structure.samples import as_batch, as_positions, same_samples
from ..structure.state import RobotMotion
from .actuation import Sharing
from .backward import backward
from .forward import forward
from .inverse_guards import Guards
from .loads import all_loads
from .reactions import Reactions
from .state_checks import check_closed

#: What to advise where a passive motion would need an effort.
HINT = 'Give the accelerations that need no effort there, or pass passive="solved"'


@dataclass(frozen=True)
class InverseResult:
    """Result of the inverse model.

    Attributes:
        tau: Efforts, shape (T, motors), [N or N m].
        residual: Worst closure residual of each sample, as `closure_residual` computes it, shape (T,).
        reactions: Wrenches between modules and in the closures, or None where they were not asked for.
    """

    tau: Array
    residual: Array
    reactions: Reactions | None


@overload
def idm(
    robot: HybridRobot, q: Array, v: Array, a: Array, *, wrenches: Mapping[str, Array] | None = ...,
    effects: Choice = ..., time: ArrayLike | None = ..., passive: str = ...,
    weights: Mapping[str, float] | Array | None = ...,
    on_singular: str = ..., reactions: Literal[False] = ...,
) -> Array: ...  # fmt: skip
@overload
def idm(
    robot: HybridRobot, q: Array, v: Array, a: Array, *, wrenches: Mapping[str, Array] | None = ...,
    effects: Choice = ..., time: ArrayLike | None = ..., passive: str = ...,
    weights: Mapping[str, float] | Array | None = ...,
    on_singular: str = ..., reactions: Literal[True],
) -> tuple[Array, Reactions]: ...  # fmt: skip
def idm(
    robot: HybridRobot,
    q: Array,
    v: Array,
    a: Array,
    *,
    wrenches: Mapping[str, Array] | None = None,
    effects: Choice = None,
    time: ArrayLike | None = None,
    passive: str = "given",
    weights: Mapping[str, float] | Array | None = None,
    on_singular: str = "raise",
    reactions: bool = False,
) -> Array | tuple[Array, Reactions]:
    """Compute the motor efforts that move a robot as prescribed.

    B tau = Psi^T H + sum_o a_o^T W_o, module after module from the outermost inwards, Eqs. (16), (31)-(33).

    Args:
        robot: The robot.
        q: Positions of the spanning tree, shape (nq,) or (T, nq).
        v: Rates, shape (nv,) or (T, nv), [m/s, rad/s].
        a: Accelerations, shape (nv,) or (T, nv), [m/s^2, rad/s^2].
        wrenches: For each link a wrench ON it, shape (6,) or (T, 6), [N, N m], in the link's frame at its
            origin.
        effects: What is computed: None for gravity, inertia, the legs' inertia and velocity terms; "model"
            for those and all that the robot's files state; or names and objects (`hybridyn.effects`), and
            nothing else.
        time: Time of each sample, shape () or (T,), [s], for effects that follow a table.
        passive: "given": `a` is used as given, and a passive motion that would need an effort is an
            error; an idle one (a rod's spin, which moves no output and no centre of mass) never is. "solved":
            only the motors' accelerations (and a prescribed base's) count, the rest follows from zero effort.
        weights: For each motor w in the sum of w x effort^2 that redundant motors make least, by name or in
            the order of `robot.motors`; by effort limits where left out.
        on_singular: "raise", or "least-norm" to go on with the least efforts where motors lose a direction,
            and with those of the branch that v is on where closures lose rank.
        reactions: Also return the wrenches between modules and in the closures.

    Returns:
        Efforts in the order of `robot.motors`, shape (motors,) or (T, motors), [N or N m]; with
        `reactions=True` also a `Reactions`.

    Raises:
        AssemblyError: The state does not close the loops.
        SingularityError: The motors lose a direction, or closures lose rank, and `on_singular` is "raise"; no
            digit of the efforts is left next to lost rank; or a velocity lies on no branch there.
        ActuationError: A passive motion would need an effort.
        ModelError: Effects that are unknown, without numbers, or contradict each other.
        TrajectoryError: Arrays of the wrong shape, or not finite; an unknown link; a table too short.

    Source:
        Ibrahim & Khalil (2010), Eqs. (30)-(33); trees of modules, any mobility and number of motors are ours.
    """
    found = inverse_model(
        robot, q, v, a, wrenches=wrenches, effects=effects, time=time, passive=passive, weights=weights,
        on_singular=on_singular, reactions=reactions,
    )  # fmt: skip
    single = np.ndim(q) == 1
    tau = found.tau[0] if single else found.tau
    if found.reactions is None:
        return tau
    return tau, found.reactions.sample(0) if single else found.reactions


def inverse_model(
    robot: HybridRobot, q: Array, v: Array, a: Array, *, wrenches: Mapping[str, Array] | None = None,
    effects: Choice = None, time: ArrayLike | None = None, passive: str = "given",
    weights: Mapping[str, float] | Array | None = None, on_singular: str = "raise", reactions: bool = False,
) -> InverseResult:  # fmt: skip
    """Compute what `idm` does, always as a batch, with the closure residuals of the states; see there."""
    on = choose(robot, effects)
    q = as_positions(robot, q, base_given=on.base is None)[0]
    v, a = as_batch(v, robot.nv, "v")[0], as_batch(a, robot.nv, "a")[0]
    same_samples(q=q, v=v, a=a)
    _one_of("on_singular", on_singular, "raise", "least-norm")
    _one_of("passive", passive, "given", "solved")
    time = times(time, len(q))
    if on.base is not None:
        q, v, a = on.base.into(robot, time, q, v, a)
    loads = all_loads(robot, on, q, v, time, wrenches)
    if passive == "solved":
        from .passive import solve_passive

        a = solve_passive(robot, q, v, a, loads)
    v, a = on.inertia.motion(v, a) if on.inertia else (np.zeros_like(v), np.zeros_like(a))
    states = forward(robot, q, v, a, on.gravity, classical=on.velocity is not None)
    residual = check_closed(robot, states, q, v, a)
    sharing = Sharing(_weights(robot, weights), on_singular, HINT if passive == "given" else "")
    result = Reactions.empty(len(q)) if reactions else None
    tau = np.zeros((len(q), len(robot.motors)))
    motion = RobotMotion(q, v, a)
    backward(robot, states, loads, Guards(robot, motion, sharing), tau, result, motion)
    if on.limits is not None:
        on.limits.check(robot, tau)
    return InverseResult(tau, residual, result)


def _one_of(name: str, value: str, *allowed: str) -> None:
    """Refuse a value that is not allowed.

    Raises:
        TrajectoryError: With those that are.
    """
    if value not in allowed:
        raise TrajectoryError(f"{name} must be {' or '.join(map(repr, allowed))}, not {value!r}")


def _weights(robot: HybridRobot, weights: Mapping[str, float] | Array | None) -> Array | None:
    """Return weights in the order of the motors.

    Raises:
        ActuationError: A weight is missing, unknown or not positive.
    """
    if weights is None:
        return None
    if isinstance(weights, Mapping):
        unknown = sorted(set(weights) - set(robot.motors))
        missing = [m for m in robot.motors if m not in weights]
        if unknown or missing:
            raise ActuationError(f"weights: unknown motors {unknown}, missing motors {missing}")
        weights = np.array([weights[m] for m in robot.motors])
    out = np.asarray(weights, dtype=float)
    if out.shape != (len(robot.motors),) or not (np.isfinite(out).all() and (out > 0).all()):
        raise ActuationError(f"weights must be {len(robot.motors)} positive numbers")
    return out
