"""The pass of a command over a table: read blocks, compute, write the result, and say how it went."""

import contextlib
import time
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple, Protocol

import click
import numpy as np

from ...streams.departures import Departures
from ...streams.one_pass import BlockResults, Model, Pass
from ...streams.reaction_columns import reaction_columns, shared_wrenches
from ...streams.workers import Workers, keep_freed_memory
from ...tables.layout import Layout
from ...tables.opening import Table, open_table
from ...tables.results import open_results
from .engine_choice import EngineChoice
from .one_table import CommandTables
from .options import RobotChoice
from .progress import progress
from .summary import Drawing
from .text import counted

#: Numbers in a table above which several processes pay: about three seconds of work for one.
LONG_TABLE = 300_000
#: The same with compiled models: about two seconds, of which another process takes half a second to start.
LONG_FOR_COMPILED = 3_000_000


class Observer(Protocol):
    """What watches the results of a pass, block by block, and says at the end what it saw."""

    def add(self, done: BlockResults) -> None:
        """Add a block."""

    def show(self, layout: Layout, left: Departures, quiet: bool) -> None:
        """Print what was seen, and the limits that joints leave; on standard error only if not `quiet`."""


class CommandPlan(NamedTuple):
    """The computation of a command.

    Attributes:
        model: The model to evaluate on each block.
        columns: Columns of the result after the time; None where no rows are written.
        observers: What watches the results.
        engine: What computes.
        remarks: Lines at the end of the summary.
    """

    model: Model
    columns: Sequence[str] | None
    observers: Sequence[Observer]
    engine: EngineChoice
    remarks: Sequence[str]


def run(
    tables: CommandTables, load: RobotChoice, plan: Callable[[Pass], CommandPlan], *,
    outputs: Sequence[str] = (), efforts: bool = False,
) -> Departures:  # fmt: skip
    """Read a table, compute block by block, write the result and print the summary.

    Args:
        plan: Function of the pass that returns the computation.
        outputs: As for `Pass`, like the next.

    Returns:
        The limits that joints leave.

    Raises:
        HybridynError: A file or a row is wrong; no file is written then.
    """
    keep_freed_memory()
    started = time.perf_counter()
    with contextlib.ExitStack() as opened:
        table = opened.enter_context(open_table(tables.source))
        given = Pass(load(), table, outputs=outputs, efforts=efforts, redundancy=tables.redundancy)
        planned = plan(given)
        compiled = planned.engine.model is not None
        workers = opened.enter_context(Workers(_processes(tables.jobs, table, compiled)))
        loaded = time.perf_counter()
        observers = [*_drawings(tables, given, planned.columns), *planned.observers]
        with _writer(tables, given, planned.columns) as write:
            samples, left = _compute(given, planned, workers, [*(one.add for one in observers), write])
    took = _speed(samples, started, loaded, time.perf_counter(), workers.count)
    for observer in observers:
        observer.show(given.layout, left, tables.quiet)
    if not tables.quiet:
        wrenches = shared_wrenches(given.robot) if tables.reactions else []
        lines = [*map(str, given.left), *planned.remarks, str(planned.engine), took, *wrenches]
        click.echo("\n".join(lines), err=True)
    return left


def _compute(
    given: Pass, planned: CommandPlan, workers: Workers, takers: Sequence[Callable[[BlockResults], None]]
) -> tuple[int, Departures]:
    """Compute block by block, and hand the results on; return the number of samples and the limits left."""
    models, rows, samples, left = planned.engine.model, given.table.rows, 0, Departures()
    with progress() as show:
        for done in given.blocks(planned.model, None if models is None else models.assemble, workers):
            left.add(done.left, done.first_row, done.time)
            planned.engine.handed_over += done.handed_over
            for take in takers:
                take(done)
            samples += len(done.rows)
            show(samples, min(samples / rows, 1.0) if rows else None)
    return samples, left


def _speed(samples: int, started: float, loaded: float, finished: float, processes: int) -> str:
    """Return the line on the time that samples took, from the times of a clock [s]."""
    shared = f" in {processes} processes" if processes > 1 else ""
    speed = f"{samples / max(finished - loaded, 1e-9):,.0f} samples/s{shared}"
    return f"{counted(samples, 'sample')}, {speed}, wall time {finished - started:.2f} s"


def _drawings(tables: CommandTables, given: Pass, columns: Sequence[str] | None) -> list[Drawing]:
    """Return the chart of the rows that the user wants, if any."""
    if not tables.plot or columns is None:
        return []
    return [Drawing(given.robot, given.table, columns, tables.plot)]


def _processes(jobs: int | None, table: Table, compiled: bool) -> int:
    """Return the number of processes to start, 0 to compute in this one."""
    long = LONG_FOR_COMPILED if compiled else LONG_TABLE
    if jobs is None and (table.rows or 0) * len(table.columns) > long:
        from ...studies.pools import cores

        jobs = cores()
    return 0 if jobs in (None, 1) else jobs


@contextlib.contextmanager
def _writer(
    tables: CommandTables, given: Pass, columns: Sequence[str] | None
) -> Iterator[Callable[[BlockResults], None]]:
    """Yield a function that writes the results of a block; files appear when they are complete."""
    targets: dict[str, tuple[str | None, Sequence[str]]] = {}
    if columns is not None:
        targets["rows"] = (tables.output, columns)
    if tables.reactions:
        targets["reactions"] = (tables.reactions, reaction_columns(given.robot))
    time_column = [] if given.layout.time is None else ["time"]
    with contextlib.ExitStack() as files:
        writes = {
            name: files.enter_context(open_results(target, [*time_column, *names]))
            for name, (target, names) in targets.items()
        }

        def write(done: BlockResults) -> None:
            """Write the rows of a block."""
            for name, to in writes.items():
                rows = getattr(done, name)
                to(rows if done.time is None else np.column_stack([done.time, rows]))

        yield write
