"""Direct dynamic model: accelerations from motor efforts, Eqs. (38)-(53) in their general form.

There are three recursions: forward for placements and twists (`forward`), backward for articulated inertias
(`articulate`), and forward for accelerations (`accelerate`).
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Literal, overload

import numpy as np
from numpy.typing import ArrayLike

from ..effects.choice import Choice, Effects, choose, times
from ..errors import ModelError, TrajectoryError
from ..spatial import Array
from ..structure.module import ModuleState
from ..structure.robot import HybridRobot
from ..structure.samples import as_efforts, as_positions, as_rates, same_samples
from .backward import reactions_of
from .direct_recursion import accelerate, articulate
from .forward import forward
from .loads import Loads, all_loads, in_every_sample
from .reactions import Reactions
from .results import Result
from .state_checks import check_closed


@overload
def ddm(
    robot: HybridRobot, q: Array, v: Array, tau: Array, *, base_acceleration: Array | None = ...,
    wrenches: Mapping[str, Array] | None = ..., effects: Choice = ..., time: ArrayLike | None = ...,
    reactions: Literal[False] = ...,
) -> Array: ...  # fmt: skip
@overload
def ddm(
    robot: HybridRobot, q: Array, v: Array, tau: Array, *, base_acceleration: Array | None = ...,
    wrenches: Mapping[str, Array] | None = ..., effects: Choice = ..., time: ArrayLike | None = ...,
    reactions: Literal[True],
) -> tuple[Array, Reactions]: ...  # fmt: skip
def ddm(
    robot: HybridRobot,
    q: Array,
    v: Array,
    tau: Array,
    *,
    base_acceleration: Array | None = None,
    wrenches: Mapping[str, Array] | None = None,
    effects: Choice = None,
    time: ArrayLike | None = None,
    reactions: bool = False,
) -> Array | tuple[Array, Reactions]:
    """Compute the accelerations of a robot under motor efforts.

    Take q and v from `hybridyn.assemble`, or state them for every joint. The modules are computed one after
    another, from the outermost to the base and back, Eqs. (40), (51).

    Args:
        robot: The robot.
        q: Positions of the spanning tree, shape (nq,) or (T, nq).
        v: Rates, shape (nv,) or (T, nv), [m/s, rad/s].
        tau: Efforts in the order of `robot.motors`, shape (motors,) or (T, motors), [N or N m].
        base_acceleration: Spatial acceleration of a "moving" base in its own frame (as in Pinocchio: the
            first six entries of a), shape (6,) or (T, 6); zero if None.
        wrenches: External wrench on each link, by link name, shape (6,) or (T, 6), [N, N m], in the link's
            frame at its origin.
        effects: Effects to compute. None: gravity, inertia, the legs' inertia and velocity terms. "model":
            these and all effects that the robot's files define. Names and objects
            (`hybridyn.effects`): only these.
        time: Time of each sample, shape () or (T,), [s], for effects that follow a table.
        reactions: Also return the wrenches between modules and in the closures.

    Returns:
        Accelerations of the spanning tree, shape (nv,) or (T, nv), [m/s^2, rad/s^2]; with `reactions=True`
        also a `Reactions`. Motions without inertia and without forces get least-norm accelerations.

    Raises:
        AssemblyError: The state does not close the loops.
        SingularityError: Closures lose rank, or a force acts on a motion without inertia.
        ActuationError: A gear locks itself, or friction that grows with load may jam joints.
        ModelError: Effects are unknown, lack parameters or contradict each other, "inertia" is missing, or
            the motion does not determine a load on which friction depends.
        TrajectoryError: An array has the wrong shape or is not finite, a link is unknown, or a table is too
            short.

    Source:
        Ibrahim & Khalil (2010), Eqs. (38)-(53). The paper drops a_dot v_r from xi; `Basis.drift` keeps it.

    Example:
        >>> robot = hybridyn.load("five_bar")
        >>> q, v, a = hybridyn.assemble(robot, motors=([0.1, 0.2], [1.0, 0.0], [0.0, 0.0]))
        >>> a = hybridyn.ddm(robot, q, v, tau=[1.0, -1.0])
        >>> a[robot.motor_v].round(2)
        array([-16.47,   9.37])
        >>> hybridyn.idm(robot, q, v, a).round(6)
        array([ 1., -1.])
    """
    return direct_model(
        robot, q, v, tau, base_acceleration=base_acceleration, wrenches=wrenches, effects=effects, time=time,
        reactions=reactions,
    ).returned(np.ndim(q) == 1)  # fmt: skip


def direct_model(
    robot: HybridRobot, q: Array, v: Array, tau: Array, *, base_acceleration: Array | None = None,
    wrenches: Mapping[str, Array] | None = None, effects: Choice = None, time: ArrayLike | None = None,
    reactions: bool = False,
) -> Result:  # fmt: skip
    """Compute the result of `ddm` as a batch, together with the closure residuals of the states."""
    on = choose(robot, effects)
    q = as_positions(robot, q, base_given=on.base is None)[0]
    v, tau = as_rates(robot, v)[0], as_efforts(robot, tau)[0]
    same_samples(q=q, v=v, tau=tau)
    time = times(time, len(q))
    needs_inertia(on)
    a = np.zeros_like(v)
    if base_acceleration is not None:
        a[:, :6] = acceleration_of_base(robot, base_acceleration, len(q))
    if on.base is not None:
        q, v, a = on.base.into(robot, time, q, v, a)
    tau = on.within_bounds(robot, tau, v)
    if on.gears is not None:
        tau = on.gears.behind(robot, tau, v)
    loads = all_loads(robot, on, q, v, time, wrenches)
    states = states_before(robot, on, q, v, a)
    residual = check_closed(robot, states, q, v)
    loads = with_load_friction(robot, states, q, v, a, tau, loads)
    accelerate(robot, articulate(robot, states, loads, tau, None), v, a)
    result = reactions_of(robot, q, v, a, tau, loads) if reactions else None
    return Result(a, residual, result)


def solve(
    robot: HybridRobot,
    q: Array,
    v: Array,
    a: Array,
    tau: Array,
    loads: Loads,
    prescribed: Array | None = None,
) -> Array:
    """Compute accelerations at states that close the loops.

    Args:
        q: Positions, shape (T, nq).
        v: Rates, shape (T, nv).
        a: Accelerations, shape (T, nv): those of a moving base are read, the others filled in place.
        tau: Efforts of the motors, shape (T, motors).
        loads: External wrenches and effects.
        prescribed: Accelerations, shape (T, nv), whose entries for motors are prescribed, or None.

    Returns:
        Closure residuals of the states, shape (T,).
    """
    states = states_before(robot, loads.on, q, v, a)
    residual = check_closed(robot, states, q, v)
    accelerate(robot, articulate(robot, states, loads, tau, prescribed), v, a)
    return residual


def states_before(robot: HybridRobot, on: Effects, q: Array, v: Array, a: Array) -> list[ModuleState]:
    """Compute the states of modules before their accelerations are known, of which a moving base's are read.

    Without velocity terms, forces depend on the observer: the classical one is taken for all others.
    """
    return forward(robot, q, v, None, on.gravity, classical=on.velocity is not None, base=a)


def with_load_friction(
    robot: HybridRobot, states: list[ModuleState], q: Array, v: Array, a: Array, tau: Array, loads: Loads, *,
    passing: bool = False,
) -> Loads:  # fmt: skip
    """Return loads with the efforts of friction that grows with load, if that is among their effects.

    Args:
        states: From `states_before`; they close the loops.
        a: Accelerations, shape (T, nv), of which those of a moving base are read.
        tau: Efforts behind the gears, shape (T, motors).
        passing: As in `articulate`.

    Raises:
        SingularityError: As `articulate`.
        ModelError: The motion does not determine a wrench on which friction depends.
        ActuationError: Joints may jam.
    """
    law = loads.on.loaded
    if law is None:
        return loads
    from .friction_response import answering  # which most robots need not, as the next
    from .load_friction import settle_moving

    D = law.directions(v)
    start, modules = answering(robot, law, D, states, q, v, a, tau, loads, passing=passing)
    length = max(module.mechanism.length for module in robot.modules)
    friction = settle_moving(law, start, modules, length)
    return replace(loads, joints=loads.joints + np.einsum("tij,tj->ti", D, friction))


def acceleration_of_base(robot: HybridRobot, acceleration: ArrayLike, samples: int) -> Array:
    """Check and return the acceleration of a moving base, shape (samples, 6).

    Raises:
        TrajectoryError: The base is not "moving", the shape is wrong, or a number is not finite.
    """
    if robot.base != "moving":
        raise TrajectoryError("base_acceleration is for base='moving'")
    return in_every_sample(acceleration, "base_acceleration", samples)


def needs_inertia(on: Effects) -> None:
    """Raise if the effects of a direct model do not include inertia.

    Raises:
        ModelError: The effect "inertia" is missing.
    """
    if on.inertia is None:
        raise ModelError(
            "the direct model needs the effect 'inertia': without it efforts cause no accelerations. "
            "For statics use the inverse model",
            element="inertia",
        )


def solve_passive(robot: HybridRobot, q: Array, v: Array, a: Array, loads: Loads) -> Array:
    """Compute accelerations that equal `a` at motors and at a moving base, and need no effort elsewhere.

    The recursions are those of the direct model without motor efforts, with two changes: Psi Z replaces Psi,
    where Z spans the motions with fixed motors, and the drift includes the prescribed accelerations.

    Args:
        q: Positions, shape (T, nq).
        v: Rates, shape (T, nv).
        a: Accelerations, shape (T, nv).
        loads: External wrenches and effects.

    Returns:
        Accelerations, shape (T, nv).
    """
    needs_inertia(loads.on)
    out = a.copy()
    solve(robot, q, v, out, np.zeros((len(q), len(robot.motors))), loads, a)
    return out
