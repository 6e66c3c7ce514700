"""The rows of a table on their way through a model, block by block, in order, in one process or several.

Several processes work on neighbouring blocks at once. A trajectory must stay on its assembly branch from
block to block, so each block has the row before it in front: its posture must be the one that the block
before ended in. Where it is not, the block is done again from there. One process goes about it in the same
way, and blocks do not depend on the number of processes: so the results have the same bits.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from ..errors import HybridynError, TrajectoryError
from .postures import Postures, postures, rows_named
from .workers import Failure, Workers

if TYPE_CHECKING:
    from ..description.records import Array
    from ..structure.departures import Departure
    from ..structure.robot import HybridRobot
    from ..tables.columns import Layout
    from ..tables.trajectory import Motion

#: Relative; two closed postures on one branch agree to rounding, two branches to nothing.
SAME_POSTURE = 1e-9
#: Numbers: some three seconds of work for one process.
LONG_TABLE = 300_000
#: Positions of a block: its arrays stay near the cache, which processes share.
NUMBERS_AT_ONCE = 84_000
#: Rows of a block: enough for a batch, few enough for several processes to share a short table.
MOST_ROWS = 1_000
#: Blocks in a row that were done again: more guesses are not worth making.
BLIND = 2


class Rows(NamedTuple):
    """What a model makes of postures.

    Attributes:
        result: Rows of the result, shape (T, columns).
        reactions: Rows of the reactions, shape (T, columns), or None.
        handed_over: Samples that compiled models handed to the general path.
        left: Limits that joints leave.
    """

    result: Array
    reactions: Array | None = None
    handed_over: int = 0
    left: tuple[Departure, ...] = ()


Model = Callable[["HybridRobot", Postures], Rows]


class Block(NamedTuple):
    """Consecutive rows.

    Attributes:
        motion: The rows, and in front of them `lead` rows of the block before.
        lead: 0, or 1 where the rows go on from the block before.
    """

    motion: Motion
    lead: int


class Done(NamedTuple):
    """What a block came to.

    Attributes:
        first_row: Number of its first own row in the table.
        time: Times of its own rows, shape (T,), [s], or None.
        rows: Rows of the result, shape (T, columns).
        reactions: Rows of the reactions, shape (T, columns), or None.
        residual: Relative closure residuals, shape (T,).
        first: Posture of its first row, that of the lead if there is one, shape (nq,).
        last: Posture of its last row, shape (nq,).
        handed_over: Samples that compiled models handed to the general path.
        left: Limits that joints leave.
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


@dataclass(frozen=True)
class Work:
    """What is done to each block; it travels to other processes.

    Attributes:
        robot: The robot.
        layout: The meaning of the table's columns.
        model: What to compute.
    """

    robot: HybridRobot
    layout: Layout
    model: Model

    def __call__(self, block: Block, guess: Array | None) -> Done:
        """Do a block.

        Args:
            block: The block.
            guess: Posture near its first row, shape (nq,), or None for the home posture.

        Raises:
            HybridynError: Something is wrong with a row; the message names file and row.
        """
        import numpy as np

        import hybridyn

        with np.errstate(
            all="ignore"
        ):  # numbers too large for the model show in its results, which are checked
            whole = postures(self.robot, block.motion, self.layout, guess)
            own = whole.after(block.lead) if block.lead else whole
            with rows_named(self.layout, own.motion):
                made = self.model(self.robot, own)
            rows = made.result
            residual = hybridyn.closure_residual(self.robot, own.q)
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
        rows: Most rows in a block.
        connected: Whether each block goes on from the one before.

    Yields:
        Blocks in order.
    """
    before: Motion | None = None
    for motion in motions:
        for start in range(0, motion.size, rows):
            own = motion.part(start, start + rows)
            yield Block(own, 0) if before is None else Block(own.after(before), 1)
            before = own.part(own.size - 1, own.size) if connected else None


def rows_at_once(robot: HybridRobot) -> int:
    """Return how many rows make a block: fewer for a large robot, whatever the number of processes."""
    return max(1, min(MOST_ROWS, NUMBERS_AT_ONCE // max(robot.nq, 1)))


def in_order(work: Work, given: Iterable[Block], workers: Workers) -> Iterator[Done]:
    """Do blocks one after the other, or several at once in other processes.

    Args:
        work: What is done to each.
        given: The blocks; only as many as there are processes are held at once.
        workers: The processes; without any, the work is done here.

    Yields:
        What each block came to, in their order.

    Raises:
        HybridynError: The first that the rows, in their order, give reason for.
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
        if chain.blind or not workers:
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
    """Blocks linked by the postures in which one ends and the next begins."""

    def __init__(self, work: Work) -> None:
        self.work, self.missed = work, 0
        self.last: Array | None = None

    @property
    def blind(self) -> bool:
        """Whether guesses do not help: postures depend on the way to them (a rod that spins freely)."""
        return self.missed >= BLIND

    def alone(self, block: Block) -> Done:
        """Do a block here, as another process would."""
        if self.blind or not block.lead:
            return self.do(block)
        try:
            result: Done | Failure = self.work(block, None)
        except HybridynError as error:
            result = Failure(error)
        return self.link(block, result)

    def do(self, block: Block) -> Done:
        """Do a block here, from where the one before ended."""
        done = self.work(block, self.last if block.lead else None)
        self.last = done.last
        return done

    def link(self, block: Block, result: Done | Failure) -> Done:
        """Take what another process made of a block, or do it again where that went another way."""
        if isinstance(result, Failure) and not block.lead:
            raise result.error
        if self.blind and block.lead:  # given before anybody knew: one process would not have tried
            return self.do(block)
        if isinstance(result, Failure) or not self._goes_on(block, result):
            self.missed += 1
            return self.do(block)
        self.missed, self.last = 0, result.last
        return result

    def _goes_on(self, block: Block, result: Done) -> bool:
        import numpy as np

        if not block.lead or self.last is None:
            return True
        scale = 1.0 + np.abs(self.last).max(initial=0.0)
        return bool(np.abs(result.first - self.last).max(initial=0.0) <= SAME_POSTURE * scale)
