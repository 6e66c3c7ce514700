"""One pass over a table: its rows become postures, and these go through a model, block by block, in order.

This process reads the table and follows the postures, each from the one before, so that a trajectory stays on
its assembly branch. The model may compute blocks in several processes at once. Blocks do not depend on the
number of processes, so the results are the same bits.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from ..assembly.chain.left import left_to_rule
from ..assembly.posture import check_joints, holding
from ..assembly.redundancy import LEAST, LeftToRule, check_rule
from ..assembly.requests import gather_requests
from ..assembly.task import closure_residual
from ..dynamics.inverse import idm
from ..effects.choice import Effects
from ..errors import HybridynError, TrajectoryError
from ..spatial import Array
from ..structure.robot import HybridRobot
from ..tables.columns import read_layout
from ..tables.layout import Layout
from ..tables.opening import Table, open_table
from ..tables.trajectory import read_motions
from .departures import Departure
from .postures import Assemble, TreeSamples, postures, rows_named
from .workers import Workers

#: Positions in a block, so that its arrays stay near the cache, which processes share.
NUMBERS_AT_ONCE = 84_000
#: Maximum number of rows in a block: enough for a batch, few enough to share a short table among processes.
MOST_ROWS = 1_000


class BlockResults(NamedTuple):
    """Results of a model at the postures of a block.

    Attributes:
        rows: Rows of the result, shape (T, columns).
        reactions: Rows of the reactions, shape (T, columns), or None.
        handed_over: Samples that compiled models handed to the general path.
        left: Joint limits that are exceeded.
        residual: Closure residuals of the postures, shape (T,), or None before `compute` adds them.
        first_row: Number of the first row in the table, which `compute` adds.
        time: Times of the rows, shape (T,), [s], or None; `compute` adds them.
    """

    rows: Array
    reactions: Array | None = None
    handed_over: int = 0
    left: tuple[Departure, ...] = ()
    residual: Any = None
    first_row: int = 1
    time: Array | None = None


Model = Callable[[HybridRobot, TreeSamples], BlockResults]


def compute(robot: HybridRobot, layout: Layout, model: Model, block: TreeSamples) -> BlockResults:
    """Compute a block.

    Args:
        layout: The meaning of the table's columns.
        model: The model to evaluate.
        block: The postures.

    Raises:
        HybridynError: A row is wrong; the message names file and row.
    """
    with np.errstate(all="ignore"):  # overflow shows in the results, which are checked
        with rows_named(layout, block.motion):
            made = model(robot, block)
        residual = closure_residual(robot, block.q) if made.residual is None else made.residual
    wrong = np.flatnonzero(~np.isfinite(made.rows).all(axis=1))
    first_row = block.motion.first_row
    if len(wrong):
        message = "the results are not finite: the numbers of this row are too large"
        raise TrajectoryError(message, file=layout.file, row=first_row + int(wrong[0]))
    return made._replace(residual=residual, first_row=first_row, time=block.motion.time)


def rows_at_once(robot: HybridRobot) -> int:
    """Return the number of rows in a block: fewer for large robots, whatever the number of processes."""
    return max(1, min(MOST_ROWS, NUMBERS_AT_ONCE // max(robot.nq, 1)))


class Pass:
    """A robot and an open table, whose rows are read once.

    Attributes:
        robot: The robot. It is the one given, or one with the same q in which the outputs are not cut away.
        table: The table.
        layout: The meaning of its columns.
        left: What the table leaves to the rule, once rows have been read.
    """

    def __init__(
        self,
        robot: HybridRobot,
        table: Table,
        *,
        outputs: Sequence[str] = (),
        efforts: bool = False,
        redundancy: str = LEAST,
    ) -> None:
        """Read the header.

        Args:
            outputs: Output joints: a table that names one of them need not name the motors that move them.
            efforts: Whether the table has efforts.
            redundancy: The rule for freedoms that poses leave, as in `hybridyn.assemble`.

        Raises:
            HybridynError: The table does not state a motion of the robot, or an output is no joint.
        """
        check_rule(redundancy)
        motors: Sequence[str] = robot.motors
        if outputs:
            from ..dynamics.quantities.joint_map import motors_beside  # most tables state motors alone

            check_joints(robot, outputs)
            replaced, robot = motors_beside(robot, outputs), holding(robot, outputs)
            if any(column.startswith(f"{joint}/") for column in table.columns for joint in outputs):
                motors = (*(motor for motor in motors if motor not in replaced), *outputs)
        self.robot, self.table, self.left = robot, table, list[LeftToRule]()
        self._redundancy = redundancy
        self.layout: Layout = read_layout(
            table.columns, robot.description, motors=motors, base=robot.base, file=table.file,
            efforts=efforts, passive=robot.mobility - 6 * (robot.base == "floating") - len(robot.motors),
        )  # fmt: skip

    def blocks(self, model: Model, assemble: Assemble | None, workers: Workers) -> Iterator[BlockResults]:
        """Return the results of a model, block by block.

        Args:
            assemble: Assembles the rows; None for the general path, in C where the rows are many.
            workers: The processes.

        Raises:
            HybridynError: A row is wrong, the first one of all; the message names file and row.
        """
        work = partial(compute, self.robot, self.layout, model)
        return workers.over(work, ((block,) for block in self.postures(assemble)))

    def postures(self, assemble: Assemble | None = None) -> Iterator[TreeSamples]:
        """Yield the postures of the rows, block by block; arguments and errors are those of `blocks`."""
        from ..compiled import TableAssembler

        assemble = partial(assemble or TableAssembler(self.robot), redundancy=self._redundancy)
        rows, guess = rows_at_once(self.robot), None
        connected = self.layout.time is not None and not self.layout.full_state
        for motion in read_motions(self.table, self.layout):
            for start in range(0, motion.size, rows):
                with np.errstate(all="ignore"):  # overflow shows in the results, which are checked
                    part = motion.part(start, start + rows)
                    block = postures(self.robot, part, self.layout, guess, assemble)
                if part.first_row == 1 and part.platforms and not self.layout.full_state:
                    given = self.robot, part.joints, part.platforms
                    requests = gather_requests(*given, redundancy=self._redundancy)
                    self.left = left_to_rule(self.robot, requests, block.q[0])
                yield block
                guess = block.q[-1] if connected else None


def read_postures(robot: HybridRobot, file: str, redundancy: str = LEAST) -> tuple[Layout, TreeSamples]:
    """Read a whole table and compute its postures, as `Pass` does; also return the meaning of its columns."""
    with open_table(file) as table:
        whole = Pass(robot, table, redundancy=redundancy)
        return whole.layout, TreeSamples.joined([*whole.postures()])


def efforts_in_blocks(
    robot: HybridRobot, q: Array, v: Array, a: Array, on: Effects, *,
    wrenches: Mapping[str, Array] | None = None, time: Array | None = None,
) -> Array:  # fmt: skip
    """Compute motor efforts as `hybridyn.idm` does, block by block.

    Args:
        q: Positions, shape (T, nq).
        v: Rates, shape (T, nv), [m/s, rad/s].
        a: Accelerations, shape (T, nv), [m/s^2, rad/s^2].
        on: Effects to compute.
        wrenches: External wrenches, as for `hybridyn.idm`.
        time: Times, shape (T,), [s], or None.

    Returns:
        Efforts, shape (T, motors), [N or N m].

    Raises:
        HybridynError: As in `hybridyn.idm`, for the first block with an error.
    """
    rows = rows_at_once(robot)
    found = []
    for start in range(0, max(len(q), 1), rows):
        at = slice(start, start + rows)
        outer = {link: W[at] if np.ndim(W) == 2 else W for link, W in (wrenches or {}).items()}
        now = None if time is None else time[at]
        with samples_counted_from(start):
            found.append(idm(robot, q[at], v[at], a[at], wrenches=outer, time=now, effects=on))
    return np.concatenate(found)


@contextlib.contextmanager
def samples_counted_from(start: int) -> Iterator[None]:
    """Shift the sample of an error, so that it counts from the start of the motion."""
    try:
        yield
    except HybridynError as error:
        if error.sample is not None:
            error.sample += start
        raise
