"""Reactions in C, compared with the general path when they are built."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ....dynamics.backward import reactions_of
from ....dynamics.direct import ddm
from ....dynamics.inverse import idm
from ....dynamics.loads import all_loads
from ....dynamics.reactions import Reactions
from ....effects.choice import Effects, choose
from ....spatial import Array
from ....structure.robot import HybridRobot
from ...code.scalars import Scalar
from ...comparing import SAMPLES, States, compare_at_states, trusted_nowhere
from ...library.artifact import Artifact
from ...library.building import best_lanes
from ...library.cache import Built
from ...library.calls import Library, Numbers
from ..sources import robot_key
from ..unpacking import computed_alone, reactions_in
from .following import FOLLOWING_AGREES

if TYPE_CHECKING:
    from ...code.library_source import Source


def left_out(robot: HybridRobot, on: Effects, dtype: str) -> str:
    """Return why the general path alone computes reactions, or ""."""
    if dtype != "float64":
        return f"in {dtype}"
    if None in (on.gravity, on.leg_inertia, on.velocity):
        return "without the effects that are on by default"
    names = [name for name in on.losses if on.loaded is None or name != on.loaded.effect.name]
    names += [law.name for law in on.links]
    names += [] if on.limits is None else [on.limits.name]
    return f"with the effect '{names[0]}'" if names else computed_alone(robot)


def transmitting(robot: HybridRobot, on: Effects) -> Library | None:
    """Return the library of a robot's reactions, from the cache or built; None where none can be.

    It has an inverse model of its own where friction depends on the reactions.
    """
    scalar = Scalar("float64", best_lanes("float64"))

    def write() -> Source:
        """Generate the C source."""
        from ...code.library_source import library_source
        from ...equations.request import request
        from ..inverse import rubbing_program
        from ..reactions import reactions_program

        more = [] if on.loaded is None else [rubbing_program(request(robot, on))]
        return library_source([reactions_program(request(robot, None)), *more], scalar)

    key = f"reactions {robot_key(robot, None if on.loaded is None else on)} {scalar!r}"
    artifact = Artifact(robot, key, write, partial(_check, robot, on))
    return artifact.tried(Library, "reactions: the general path computes them")


def transmitted(
    robot: HybridRobot, library: Library, on: Effects, states: States, tau: Numbers | None, threads: int
) -> tuple[Numbers, Reactions, Array]:
    """Compute the reactions of a motion.

    Args:
        on: The effects.
        states: q, v and a, shapes (T, nq), (T, nv), (T, nv).
        tau: Efforts that balance the motion, shape (T, motors); None where the library solves for them.

    Returns:
        The efforts, the reactions, and guards, shape (T,).
    """
    q, v, a = states
    along, settled = on.joint_efforts(robot, q, v), np.zeros(len(q))
    if on.loaded is not None:
        (tau, friction), settled = library.programs["idm_rubbing"].batch([q, v, a], threads)
        along += np.einsum("tij,tj->ti", on.loaded.directions(v), friction)
    assert tau is not None
    along[:, robot.motor_v] += tau
    along -= on.rotor_diagonal(robot) * a
    (root, *modules), guard = library.programs["reactions"].batch([q, v, a, along], threads)
    return tau, reactions_in(robot, root, modules), np.maximum(settled, guard)


def _check(robot: HybridRobot, on: Effects, built: Built) -> None:
    """Compare a new library with the general path, at accelerations under random efforts.

    Raises:
        CompileError: They differ, or can be trusted nowhere.
        ActuationError: Joints may jam.
    """
    library, on = Library(built), on if on.loaded is not None else choose(robot, None)

    def states(seed: int) -> States:
        """Draw q, v and tau, and the accelerations that follow."""
        from ...equations.states import moving_states

        q, v, tau = moving_states(robot, SAMPLES, seed, idle=False)
        return q, v, ddm(robot, q, v, tau, effects=on), tau

    def run(q: Array, v: Array, a: Array, tau: Array) -> tuple[list[Numbers], Array]:
        """Compute them by the library."""
        _, found, guard = transmitted(robot, library, on, (q, v, a), tau, 1)
        return _numbers(found), guard

    def general(q: Array, v: Array, a: Array, tau: Array) -> list[Array]:
        """Compute them by the general path."""
        if on.loaded is None:
            return _numbers(reactions_of(robot, q, v, a, tau, all_loads(robot, on, q, v, None, None)))
        return _numbers(idm(robot, q, v, a, effects=on, reactions=True)[1])

    if not compare_at_states(robot, "reactions", run, general, FOLLOWING_AGREES["float64"], states=states):
        raise trusted_nowhere(robot, "reactions")


def _numbers(found: Reactions) -> list[Array]:
    """Return all wrenches, and what self-stresses add to them whatever their basis."""
    T = len(found.base)
    wrenches = [
        found.base,
        *(x for part in (found.modules, found.joints, found.closures) for x in part.values()),
    ]
    shared = [np.matmul(x, np.swapaxes(x, 1, 2)).reshape(T, -1) for x in found.joints_shared.values()]
    determined = [x.astype(float) for x in found.determined.values()]
    return [np.hstack(wrenches), np.hstack([np.ones((T, 1)), *shared, *determined])]
