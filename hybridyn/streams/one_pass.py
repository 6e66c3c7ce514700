"""One pass over a table: its rows become postures, and these go through a model, in the order of the rows."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from .blocks import Done, Model, Work, blocks, in_order, rows_at_once
from .postures import Assemble, Postures, postures

if TYPE_CHECKING:
    from ..structure.robot import HybridRobot
    from ..tables.columns import Layout
    from ..tables.table import Table
    from .workers import Workers


class Pass:
    """A robot and an open table, whose rows are read once.

    Attributes:
        robot: The robot. It is the one given, or one with the same q in which the outputs are not cut away.
        table: The table.
        layout: The meaning of its columns.
    """

    def __init__(
        self, robot: HybridRobot, table: Table, *, outputs: Sequence[str] = (), efforts: bool = False
    ) -> None:
        """Read the header.

        Args:
            outputs: Output joints: a table that names one of them need not name the motors that move them.
            efforts: Whether the table has efforts.

        Raises:
            HybridynError: The table does not state a motion of the robot, or an output is no joint.
        """
        from ..tables.columns import read_layout

        motors: Sequence[str] = robot.motors
        if outputs:
            from ..assembly.posture import check_joints, holding
            from ..dynamics.quantities.joint_map import motors_beside

            check_joints(robot, outputs)
            replaced, robot = motors_beside(robot, outputs), holding(robot, outputs)
            if any(column.startswith(f"{joint}/") for column in table.columns for joint in outputs):
                motors = (*(motor for motor in motors if motor not in replaced), *outputs)
        self.robot, self.table = robot, table
        self.layout: Layout = read_layout(
            table.columns, robot.description, motors=motors, base=robot.base, file=table.file,
            efforts=efforts, passive=robot.mobility - 6 * (robot.base == "floating") - len(robot.motors),
        )  # fmt: skip

    @property
    def connected(self) -> bool:
        """Whether each posture follows the one before: the table has times, and is assembled."""
        return self.layout.time is not None and not self.layout.full_state

    def blocks(self, model: Model, assemble: Assemble | None, workers: Workers) -> Iterator[Done]:
        """Yield the results of a model, block by block.

        Args:
            assemble: Assembles the rows; None for the general path.
            workers: The processes; if there are none, this process computes.

        Raises:
            HybridynError: A row is wrong, the first one of all; the message names file and row.
        """
        from ..tables.trajectory import read_motions

        work = Work(self.robot, self.layout, model, assemble)
        workers.prepare(work)
        given = blocks(read_motions(self.table, self.layout), rows_at_once(self.robot), self.connected)
        return in_order(work, given, workers)

    def postures(self) -> Postures:
        """Return the postures of all rows, computed in C where they are many.

        Raises:
            HybridynError: A row is wrong, or cannot be assembled.
        """
        from ..compiled.programs.closing.assembling import TableAssembler
        from ..tables.trajectory import read_motions

        found: list[Postures] = []
        assemble = TableAssembler(self.robot)
        for motion in read_motions(self.table, self.layout):
            guess = found[-1].q[-1] if found and self.connected else None
            found.append(postures(self.robot, motion, self.layout, guess, assemble))
        return Postures.joined(found)


def read_postures(robot: HybridRobot, file: str) -> tuple[Layout, Postures]:
    """Read a whole table and compute its postures, as `Pass` does; also return the meaning of its columns."""
    from ..tables.opening import open_table

    with open_table(file) as table:
        whole = Pass(robot, table)
        return whole.layout, whole.postures()
