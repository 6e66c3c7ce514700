"""Reactions in C, compared with the general path when they are built."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ....dynamics.backward import reactions_of
from ....dynamics.direct import ddm
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
    names = [*on.losses, *(law.name for law in on.links)]
    names += [] if on.limits is None else [on.limits.name]
    return f"with the effect '{names[0]}'" if names else computed_alone(robot)


def transmitting(robot: HybridRobot) -> Library | None:
    """Return the library of a robot's reactions, from the cache or built; None where none can be."""
    scalar = Scalar("float64", best_lanes("float64"))

    def write() -> Source:
        """Generate the C source."""
        from ...code.library_source import library_source
        from ...equations.request import request
        from ..reactions import reactions_program

        return library_source([reactions_program(request(robot, None))], scalar)

    key = f"reactions {robot_key(robot, None)} {scalar!r}"
    artifact = Artifact(robot, key, write, partial(_check, robot))
    return artifact.tried(Library, "reactions: the general path computes them")


def transmitted(
    robot: HybridRobot, library: Library, on: Effects, states: States, tau: Numbers, threads: int
) -> tuple[Reactions, Array]:
    """Compute the reactions of a motion, and guards, shape (T,).

    Args:
        on: The effects.
        states: q, v and a, shapes (T, nq), (T, nv), (T, nv).
        tau: Efforts that balance the motion, shape (T, motors).
    """
    q, v, a = states
    along = on.joint_efforts(robot, q, v)
    along[:, robot.motor_v] += tau
    along -= on.rotor_diagonal(robot) * a
    (root, *modules), guard = library.programs["reactions"].batch([q, v, a, along], threads)
    return reactions_in(robot, root, modules), np.asarray(guard)


def _check(robot: HybridRobot, built: Built) -> None:
    """Compare a new library with the general path at random efforts.

    Raises:
        CompileError: They differ, or can be trusted nowhere.
    """
    library, on = Library(built), choose(robot, None)

    def states(seed: int) -> States:
        """Draw q, v and tau, and the accelerations that follow."""
        from ...equations.states import moving_states

        q, v, tau = moving_states(robot, SAMPLES, seed, idle=False)
        return q, v, ddm(robot, q, v, tau), tau

    def run(q: Array, v: Array, a: Array, tau: Array) -> tuple[list[Numbers], Array]:
        """Compute them by the library."""
        found, guard = transmitted(robot, library, on, (q, v, a), tau, 1)
        return _numbers(found), guard

    def general(q: Array, v: Array, a: Array, tau: Array) -> list[Array]:
        """Compute them by the general path."""
        return _numbers(reactions_of(robot, q, v, a, tau, all_loads(robot, on, q, v, None, None)))

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
