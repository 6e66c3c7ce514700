"""A trajectory that every design follows: read once, then computed for each robot, block by block."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ...assembly.reach import closed_postures
from ...dynamics.inverse import inverse_model
from ...effects import Effects
from ...errors import ActuationError, AssemblyError, SingularityError
from ...spatial import Array
from ...streams.postures import Postures, postures, rows_named
from ...structure.robot import HybridRobot
from ...tables.columns import Layout, read_layout
from ...tables.opening import open_table
from ...tables.trajectory import Motion, read_motions

#: Numbers of a table that is kept in memory; a longer one is read again for each design.
KEPT_NUMBERS = 2_000_000
#: Postures of one design at which the count of singular ones ends: beyond, the design is singular everywhere.
MOST_SINGULAR = 64

Use = Callable[[Postures, Array], None]


@dataclass
class Postmortem:
    """What went wrong on a trajectory.

    Attributes:
        unreachable: Number of postures that do not close.
        singular: Number of postures at which a matrix loses rank, at most `MOST_SINGULAR`.
        status: "ok", "unreachable", "singular" or "failed" (the motors cannot produce the motion).
        message: The first error.
    """

    unreachable: int = 0
    singular: int = 0
    status: str = "ok"
    message: str = ""

    def add(self, status: str, message: str) -> None:
        """Keep the first error."""
        if self.status == "ok":
            self.status, self.message = status, message


class Follower(NamedTuple):
    """How a trajectory is computed.

    Attributes:
        passive: As in `hybridyn.idm`.
        effects: The effects that are computed.
    """

    passive: str
    effects: Effects


@dataclass
class Track:
    """A trajectory's table, and the motions read from it for the last kind of robot.

    Attributes:
        file: The table.
    """

    file: str
    _key: object = field(default=None, repr=False)
    _kept: tuple[Layout, list[Motion]] | None = field(default=None, repr=False)

    def motions(self, robot: HybridRobot) -> Iterator[tuple[Layout, Motion]]:
        """Return the motion of a robot's joints and platforms, block by block.

        Raises:
            TrajectoryError: The table is wrong, or does not determine the motion of this robot.
        """
        description = robot.description
        key = (
            [(one.name, one.kind, one.parent, one.child) for one in description.joints],
            [one.name for one in description.links], robot.motors, robot.base,
        )  # fmt: skip
        if self._kept is not None and self._key == key:
            layout, motions = self._kept
            yield from ((layout, motion) for motion in motions)
            return
        with open_table(self.file) as table:
            layout = read_layout(
                table.columns, description, motors=robot.motors, base=robot.base, file=table.file
            )
            small = (table.rows or KEPT_NUMBERS) * len(table.columns) <= KEPT_NUMBERS
            seen: list[Motion] = []
            for motion in read_motions(table, layout):
                if small:
                    seen.append(motion)
                yield layout, motion
        if small:
            self._key, self._kept = key, (layout, seen)


def follow(robot: HybridRobot, track: Track, how: Follower, use: Use) -> Postmortem:
    """Compute the efforts of a robot along a trajectory, and count the postures at which it cannot be.

    Args:
        how: How it is computed.
        use: Called with the postures of each block and their efforts, shape (T, motors). After an error it is
            called no more.

    Raises:
        HybridynError: The table does not belong to this robot.
    """
    found = Postmortem()
    last: Array | None = None
    for layout, motion in track.motions(robot):
        guess = last if layout.time is not None and not layout.full_state else None
        try:
            block = postures(robot, motion, layout, guess)
            tau = _efforts(robot, layout, block, how)
        except (AssemblyError, SingularityError, ActuationError) as error:
            last = _count(robot, layout, motion, guess, how, error, found)
            continue
        last = block.q[-1]
        if found.status == "ok":
            use(block, tau)
    return found


def _efforts(robot: HybridRobot, layout: Layout, block: Postures, how: Follower) -> Array:
    """Compute the efforts, shape (T, motors)."""
    with rows_named(layout, block.motion):
        tau: Array = inverse_model(
            robot,
            block.q,
            block.v,
            block.a,
            wrenches=block.motion.wrenches or None,
            passive=how.passive,
            effects=how.effects,
            time=block.motion.time,
        ).values
    return tau


def _count(
    robot: HybridRobot, layout: Layout, motion: Motion, guess: Array | None, how: Follower,
    error: Exception, found: Postmortem,
) -> Array | None:  # fmt: skip
    """Count the wrong postures of a block of which one raised an error; return a posture near its end."""
    found.add(status_of(error), str(error))
    before = found.unreachable + found.singular
    if layout.full_state:
        q, closed = postures(robot, motion, layout, None).q, np.ones(motion.size, dtype=bool)
    else:
        q, closed = closed_postures(robot, motors=motion.joints, platforms=motion.platforms, guess=guess)
    found.unreachable += int((~closed).sum())
    _count_singular(robot, q[closed], how, found)
    if found.unreachable + found.singular == before:  # each posture can be, but not one after the other
        found.unreachable += isinstance(error, AssemblyError)
        found.singular += isinstance(error, SingularityError)
    return q[closed][-1] if closed.any() else guess


def _count_singular(robot: HybridRobot, q: Array, how: Follower, found: Postmortem) -> None:
    """Count the singular ones of closed postures, shape (T, nq), by the inverse model at rest."""
    while len(q) and found.singular < MOST_SINGULAR:
        rest = np.zeros((len(q), robot.nv))
        try:
            inverse_model(robot, q, rest, rest, passive=how.passive)
        except (SingularityError, AssemblyError) as wrong:
            found.singular += isinstance(wrong, SingularityError)
            found.unreachable += isinstance(wrong, AssemblyError)
            q = q[(wrong.sample or 0) + 1 :]
        except ActuationError as wrong:
            q = q[(wrong.sample or 0) + 1 :]
        else:
            return


def status_of(error: Exception) -> str:
    """Return the status of a design with an error of a posture."""
    if isinstance(error, AssemblyError):
        return "unreachable"
    return "singular" if isinstance(error, SingularityError) else "failed"
