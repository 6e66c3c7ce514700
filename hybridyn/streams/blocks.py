"""Run the rows of a table through a model, block by block, in order, in one process or several.

Several processes compute neighbouring blocks at once. A trajectory must stay on its assembly branch from
block to block. Each block therefore starts with the last row of the block before, and both blocks must find
the same posture for this row; if they do not, the block is computed again from the posture of the block
before. A single process works in the same way, and blocks do not depend on the number of processes, so the
results are the same bits.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from typing import TYPE_CHECKING, NamedTuple

from ..errors import HybridynError, TrajectoryError
from .postures import Assemble, Postures, postures, rows_named
from .workers import Failure, Workers

if TYPE_CHECKING:
    from ..description.records import Array
    from ..structure.robot import HybridRobot
    from ..tables.columns import Layout
    from ..tables.trajectory import Motion
    from .departures import Departure

#: Relative difference below which two postures are on one branch: there they agree to rounding.
SAME_POSTURE = 1e-9
#: Numbers in a table above which several processes pay: about three seconds of work for one.
LONG_TABLE = 300_000
#: The same with compiled models: about two seconds, of which another process takes half a second to start.
LONG_FOR_COMPILED = 3_000_000
#: Positions in a block, so that its arrays stay near the cache, which processes share.
NUMBERS_AT_ONCE = 84_000
#: Maximum number of rows in a block: enough for a batch, few enough to share a short table among processes.
MOST_ROWS = 1_000
#: Consecutive blocks computed again, after which blocks are no longer computed in advance.
MOST_MISSES = 2


class Rows(NamedTuple):
    """Results of a model at some postures.

    Attributes:
        result: Rows of the result, shape (T, columns).
        reactions: Rows of the reactions, shape (T, columns), or None.
        handed_over: Samples that compiled models handed to the general path.
        left: Joint limits that are exceeded.
        residual: Closure residuals of the postures, shape (T,), where the model computed them, or None.
    """

    result: Array
    reactions: Array | None = None
    handed_over: int = 0
    left: tuple[Departure, ...] = ()
    residual: Array | None = None


Model = Callable[["HybridRobot", Postures], Rows]


class Block(NamedTuple):
    """Consecutive rows.

    Attributes:
        motion: `lead` rows of the block before, then the block's own rows.
        lead: 1 where the rows continue those of the block before, else 0.
    """

    motion: Motion
    lead: int


class Done(NamedTuple):
    """Results of a block.

    Attributes:
        first_row: Number of its first own row in the table.
        time: Times of its own rows, shape (T,), [s], or None.
        rows: Rows of the result, shape (T, columns).
        reactions: Rows of the reactions, shape (T, columns), or None.
        residual: Relative closure residuals, shape (T,).
        first: Posture of its first row, that of the lead if there is one, shape (nq,).
        last: Posture of its last row, shape (nq,).
        handed_over: Samples that compiled models handed to the general path.
        left: Joint limits that are exceeded.
    """

    first_row: int
    time: Array | None
    rows: Array
    reactions: Array | None
    residual: Array
    first: Array
    last: Array
    handed_over: int = 0
    left: tuple[Departure, ...] = ()


class Work(NamedTuple):
    """The computation for each block; it is pickled for other processes.

    Attributes:
        robot: The robot.
        layout: The meaning of the table's columns.
        model: The model to evaluate.
        assemble: Assembles the rows; None for the general path.
    """

    robot: HybridRobot
    layout: Layout
    model: Model
    assemble: Assemble | None = None

    def __call__(self, block: Block, guess: Array | None) -> Done:
        """Compute a block.

        Args:
            guess: Posture near its first row, shape (nq,), or None for the home posture.

        Raises:
            HybridynError: A row is wrong; the message names file and row.
        """
        import numpy as np

        from ..assembly.task import closure_residual

        with np.errstate(all="ignore"):  # overflow shows in the results, which are checked
            whole = postures(self.robot, block.motion, self.layout, guess, self.assemble)
            own = whole.after(block.lead) if block.lead else whole
            with rows_named(self.layout, own.motion):
                made = self.model(self.robot, own)
            rows = made.result
            residual = made.residual
            if residual is None:
                residual = closure_residual(self.robot, own.q)
        wrong = np.flatnonzero(~np.isfinite(rows).all(axis=1))
        row = own.motion.first_row
        if len(wrong):
            message = "the results are not finite: the numbers of this row are too large"
            raise TrajectoryError(message, file=self.layout.file, row=row + int(wrong[0]))
        ends = whole.q[0], whole.q[-1]
        return Done(row, own.motion.time, rows, made.reactions, residual, *ends, made.handed_over, made.left)


def blocks(motions: Iterable[Motion], rows: int, connected: bool) -> Iterator[Block]:
    """Cut motions into blocks.

    Args:
        motions: Consecutive rows of a table.
        rows: Maximum number of rows in a block.
        connected: Whether each block continues the one before.
    """
    before: Motion | None = None
    for motion in motions:
        for start in range(0, motion.size, rows):
            own = motion.part(start, start + rows)
            yield Block(own, 0) if before is None else Block(own.joined([before, own]), 1)
            before = own.part(own.size - 1, own.size) if connected else None


def rows_at_once(robot: HybridRobot) -> int:
    """Return the number of rows in a block: fewer for large robots, whatever the number of processes."""
    return max(1, min(MOST_ROWS, NUMBERS_AT_ONCE // max(robot.nq, 1)))


def in_order(work: Work, given: Iterable[Block], workers: Workers) -> Iterator[Done]:
    """Compute blocks one after the other, or several at once in other processes.

    Args:
        work: The computation for each block.
        given: The blocks; only as many as there are processes are held at once.
        workers: The processes; if there are none, this process computes.

    Raises:
        HybridynError: The first error in the order of the rows.
    """
    chain = _Chain(work)
    waiting: deque[Block] = deque()
    source = iter(given)
    wrong: HybridynError | None = None
    while True:
        try:
            block = next(source)
        except StopIteration:
            break
        except HybridynError as error:  # of the table; the rows before it come first
            wrong = error
            break
        if chain.sequential or not workers:
            while waiting:
                yield chain.link(waiting.popleft(), workers.take())
            yield chain.alone(block)
            continue
        free = workers.take() if len(waiting) == len(workers) else None
        workers.give((block, None))
        waiting.append(block)
        if free is not None:
            yield chain.link(waiting.popleft(), free)
    while waiting:
        yield chain.link(waiting.popleft(), workers.take())
    if wrong is not None:
        raise wrong


class _Chain:
    """Consecutive blocks, linked by the posture of the row that they share."""

    def __init__(self, work: Work) -> None:
        self.work, self.missed = work, 0
        self.last: Array | None = None

    @property
    def sequential(self) -> bool:
        """Whether each block waits for the one before: postures depend on the path (a rod spins freely)."""
        return self.missed >= MOST_MISSES

    def alone(self, block: Block) -> Done:
        """Compute a block in this process in the same way as in another."""
        if self.sequential or not block.lead:
            return self.do(block)
        try:
            result: Done | Failure = self.work(block, None)
        except HybridynError as error:
            result = Failure(error)
        return self.link(block, result)

    def do(self, block: Block) -> Done:
        """Compute a block in this process, from the last posture of the block before."""
        done = self.work(block, self.last if block.lead else None)
        self.last = done.last
        return done

    def link(self, block: Block, result: Done | Failure) -> Done:
        """Return a block's result, computed again where it is on another branch than the block before."""
        if isinstance(result, Failure) and not block.lead:
            raise result.error
        if self.sequential and block.lead:  # sent before the misses were known; one process would not
            return self.do(block)
        if isinstance(result, Failure) or not self._continues(block, result):
            self.missed += 1
            return self.do(block)
        self.missed, self.last = 0, result.last
        return result

    def _continues(self, block: Block, result: Done) -> bool:
        import numpy as np

        if not block.lead or self.last is None:
            return True
        scale = 1.0 + np.abs(self.last).max(initial=0.0)
        return bool(np.abs(result.first - self.last).max(initial=0.0) <= SAME_POSTURE * scale)
