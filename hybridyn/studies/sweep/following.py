"""A trajectory that every design follows: read once, computed for each robot block by block."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import partial

from ...assembly.assemble import assemble
from ...dynamics.inverse import inverse_model
from ...effects import Effects
from ...spatial import Array
from ...streams.postures import TreeSamples, postures, rows_named
from ...structure.robot import HybridRobot
from ...tables.columns import read_layout
from ...tables.layout import Layout
from ...tables.opening import open_table
from ...tables.trajectory import TableMotion, read_motions


@dataclass
class Track:
    """A trajectory's table, and the motions read from it for the last kind of robot.

    Attributes:
        file: The table.
    """

    file: str
    _kept: tuple[object, Layout, list[TableMotion]] | None = field(default=None, repr=False)

    def motions(self, robot: HybridRobot) -> tuple[Layout, list[TableMotion]]:
        """Return the meaning of the columns, and the motion of a robot's joints and platforms in blocks.

        Raises:
            TrajectoryError: The table is wrong, or does not determine the motion of this robot.
        """
        description = robot.description
        key = (
            [(one.name, one.kind, one.parent, one.child) for one in description.joints],
            [one.name for one in description.links], robot.motors, robot.base,
        )  # fmt: skip
        if self._kept is None or self._kept[0] != key:
            with open_table(self.file) as table:
                layout = read_layout(
                    table.columns, description, motors=robot.motors, base=robot.base, file=table.file
                )
                self._kept = key, layout, [*read_motions(table, layout)]
        return self._kept[1:]


def follow(
    robot: HybridRobot, track: Track, passive: str, effects: Effects, redundancy: str
) -> Iterator[tuple[TreeSamples, Array]]:
    """Yield the postures of each block of a trajectory, and the efforts of the motors, shape (T, motors).

    Args:
        passive: As in `hybridyn.idm`.
        effects: The effects that are computed.
        redundancy: The rule for freedoms that poses leave, as in `hybridyn.assemble`.

    Raises:
        HybridynError: The table does not belong to this robot, or the robot cannot make the motion.
    """
    layout, motions = track.motions(robot)
    last: Array | None = None
    for motion in motions:
        guess = last if layout.time is not None and not layout.full_state else None
        block = postures(robot, motion, layout, guess, partial(assemble, robot, redundancy=redundancy))
        with rows_named(layout, motion):
            found = inverse_model(
                robot, block.q, block.v, block.a, wrenches=motion.wrenches or None, passive=passive,
                effects=effects, time=motion.time,
            )  # fmt: skip
        last = block.q[-1]
        yield block, found.values
