"""Inverse dynamic model: compute motor efforts from a motion, Eqs. (30)-(33) in their general form."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Literal, overload

import numpy as np
from numpy.typing import ArrayLike

from ..description.names import listed
from ..effects.choice import Choice, Effects, choose, times
from ..errors import ActuationError
from ..spatial import Array
from ..structure.robot import HybridRobot
from ..structure.samples import as_accelerations, as_positions, as_rates, one_of, same_samples
from .actuation import Sharing
from .backward import MotionOfModules, backward
from .forward import forward
from .loads import Loads, all_loads
from .results import Result
from .state_checks import check_closed

if TYPE_CHECKING:
    from ..effects.load_friction import OnLoads
    from .reactions import Reactions

#: Advice in the error message if a passive motion would need an effort.
HINT = 'Give the accelerations that need no effort there, or pass passive="solved"'


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
    """Compute the motor efforts for a prescribed motion of a robot.

    Take q, v, a from `hybridyn.assemble`, or state them for every joint. The modules are computed one after
    another, the outermost first, Eqs. (16), (31)-(33).

    Args:
        robot: The robot.
        q: Positions of the spanning tree, shape (nq,) or (T, nq).
        v: Rates, shape (nv,) or (T, nv), [m/s, rad/s].
        a: Accelerations, shape (nv,) or (T, nv), [m/s^2, rad/s^2].
        wrenches: External wrench on each link, by link name, shape (6,) or (T, 6), [N, N m], in the link's
            frame at its origin.
        effects: Effects to compute. None: gravity, inertia, the legs' inertia and velocity terms. "model":
            these and all effects that the robot's files define. Names and objects (`hybridyn.effects`): only
            these.
        time: Time of each sample, shape () or (T,), [s], for effects that follow a table.
        passive: "given": use `a` as given; a passive motion that would need an effort is an error, except an
            idle motion (a rod's spin, which moves no output and no centre of mass). "solved": use only the
            accelerations of motors and of a prescribed base; compute the others for zero effort.
        weights: Weight w of each motor, by name or in the order of `robot.motors`. Redundant motors minimise
            the sum of w x effort^2. If None, weights follow from the effort limits.
        on_singular: "raise", or "least-norm". The latter uses the least efforts if motors lose a direction,
            and the efforts on the branch that v belongs to if closures lose rank.
        reactions: Also return the wrenches between modules and in the closures.

    Returns:
        Efforts in the order of `robot.motors`, shape (motors,) or (T, motors), [N or N m]; with
        `reactions=True` also a `Reactions`.

    Raises:
        AssemblyError: The state does not close the loops.
        SingularityError: The motors lose a direction, or closures lose rank, and `on_singular` is "raise"; or
            closures are so close to losing rank that the efforts have no correct digit; or a velocity belongs
            to no branch there.
        ActuationError: A passive motion would need an effort, an effort exceeds a limit or what a DC motor
            gives, or friction that grows with load may jam joints.
        ModelError: Effects are unknown, lack parameters or contradict each other, or the motion does not
            determine a load on which friction depends.
        TrajectoryError: An array has the wrong shape or is not finite, a link is unknown, or a table is too
            short.

    Source:
        Ibrahim & Khalil (2010), Eqs. (30)-(33), extended here to trees of modules and to any mobility and
        number of motors.

    Example:
        >>> robot = hybridyn.load("five_bar")
        >>> q, v, a = hybridyn.assemble(robot, motors=([0.1, 0.2], [1.0, 0.0], [0.0, 0.0]))
        >>> hybridyn.idm(robot, q, v, a).round(3)
        array([ 2.128, -1.31 ])
        >>> pull = {"m1_tool": [0.0, 0.0, -10.0, 0.0, 0.0, 0.0]}
        >>> hybridyn.idm(robot, q, v, a, wrenches=pull).round(3)
        array([ 1.106, -3.418])
    """
    return inverse_model(
        robot, q, v, a, wrenches=wrenches, effects=effects, time=time, passive=passive, weights=weights,
        on_singular=on_singular, reactions=reactions,
    ).returned(np.ndim(q) == 1)  # fmt: skip


def inverse_model(
    robot: HybridRobot, q: Array, v: Array, a: Array, *, wrenches: Mapping[str, Array] | None = None,
    effects: Choice = None, time: ArrayLike | None = None, passive: str = "given",
    weights: Mapping[str, float] | Array | None = None, on_singular: str = "raise", reactions: bool = False,
) -> Result:  # fmt: skip
    """Compute the result of `idm` as a batch, together with the closure residuals of the states."""
    on = choose(robot, effects)
    q = as_positions(robot, q, base_given=on.base is None)[0]
    v, a = as_rates(robot, v)[0], as_accelerations(robot, a)[0]
    same_samples(q=q, v=v, a=a)
    one_of("on_singular", on_singular, "raise", "least-norm")
    one_of("passive", passive, "given", "solved")
    time = times(time, len(q))
    if on.base is not None:
        q, v, a = on.base.into(robot, time, q, v, a)
    loads = all_loads(robot, on, q, v, time, wrenches)
    driven = HINT if passive == "given" else "Add a motor there"
    hint = driven if robot.motors else "The robot has no motors: name them, motors=[...]"
    if robot.description.left_out:
        hint += f"; the file's actuators {listed(robot.description.left_out)} are no motors here"
    sharing = Sharing(_weights(robot, weights), on_singular, hint)
    solved = passive == "solved"
    given = None if solved else _given_motion(robot, on, q, v, a, sharing)
    if on.loaded is not None:
        loads = _with_friction(robot, on.loaded, q, v, a, loads, sharing, given)
    out = under_loads(robot, q, v, a, loads, sharing, given, solved=solved, reactions=reactions)
    if on.gears is not None:
        out = out._replace(values=on.gears.before(out.values, v))
    on.check_bounds(robot, out.values, v)
    return out


def _with_friction(
    robot: HybridRobot, law: OnLoads, q: Array, v: Array, a: Array, loads: Loads, sharing: Sharing,
    given: MotionOfModules | None,
) -> Loads:  # fmt: skip
    """Add to the loads the friction that grows with what joints carry."""
    solved = given is None
    from .friction_of_motion import answers_to_friction  # which most robots need not
    from .load_friction import answers_one_by_one, settle

    partial = sharing._replace(balanced=False)  # passive motions may need the friction that is sought

    def under(efforts: Array) -> Reactions:
        """Compute the reactions under efforts of joints."""
        more = replace(loads, joints=loads.joints + efforts)
        found = under_loads(robot, q, v, a, more, partial, given, solved=solved, reactions=True).reactions
        assert found is not None
        return found

    def answers(D: Array) -> Array:
        """Compute the wrenches that unit frictions cause; solved accelerations change with them."""
        if given is None:
            return answers_one_by_one(law, D, under)
        return answers_to_friction(robot, given, law, D, sharing)

    friction = settle(law, v, under, answers)
    return replace(loads, joints=loads.joints + friction)


def under_loads(
    robot: HybridRobot, q: Array, v: Array, a: Array, loads: Loads, sharing: Sharing,
    given: MotionOfModules | None = None, *, solved: bool, reactions: bool,
) -> Result:  # fmt: skip
    """Compute the inverse model under known loads.

    Args:
        q, v, a: Positions, rates and accelerations, shapes (T, nq), (T, nv), (T, nv).
        loads: External wrenches and effects.
        sharing: How the load is distributed among motors.
        given: The motion of modules where that is known.
        solved: Whether passive accelerations are computed for zero effort.
        reactions: Whether reactions are computed.
    """
    if solved:
        from .direct import solve_passive  # which most calls need not

        a = solve_passive(robot, q, v, a, loads)
    motion = _given_motion(robot, loads.on, q, v, a, sharing) if given is None else given
    result = None
    if reactions:
        from .reactions import Reactions  # which most calls want none of

        result = Reactions(np.zeros((len(q), 6)))
    tau = np.zeros((len(q), len(robot.motors)))
    backward(robot, motion, loads, sharing, tau, result, q)
    return Result(tau, motion.residual, result)


def _given_motion(
    robot: HybridRobot, on: Effects, q: Array, v: Array, a: Array, sharing: Sharing
) -> MotionOfModules:
    """Compute the motion of modules, at rest in statics."""
    v, a = on.inertia.motion(v, a) if on.inertia else (np.zeros_like(v), np.zeros_like(a))
    states = forward(robot, q, v, a, on.gravity, classical=on.velocity is not None)
    residual = check_closed(robot, states, q, v, a)
    return MotionOfModules(states, v, a, residual, strict=sharing.on_singular == "raise")


def _weights(robot: HybridRobot, weights: Mapping[str, float] | Array | None) -> Array | None:
    """Return the weights in the order of the motors, shape (motors,), or None."""
    if weights is None:
        return None
    if isinstance(weights, Mapping):
        unknown, missing = {*weights}.difference(robot.motors), {*robot.motors}.difference(weights)
        if unknown or missing:
            raise ActuationError(
                f"weights: unknown motors {sorted(unknown)}, missing motors {sorted(missing)}"
            )
        weights = np.array([weights[m] for m in robot.motors])
    out = np.asarray(weights, dtype=float)
    if out.shape != (len(robot.motors),) or not (np.isfinite(out).all() and (out > 0).all()):
        raise ActuationError(f"weights must be {len(robot.motors)} positive numbers")
    return out
