"""Commands that compute a table from another one, row by row: their files, and the pass over the rows."""

import contextlib
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple, Protocol

import click
import numpy as np

from ...streams.departures import Departures
from ...streams.one_pass import Model, Pass, Rows
from ...streams.reaction_columns import reaction_columns, shared_wrenches
from ...streams.workers import Workers, keep_freed_memory
from ...tables.columns import Layout
from ...tables.opening import Table, open_table
from ...tables.results import open_results
from .engine import Engine
from .files import check_targets, report_file, result_file, several
from .options import RobotChoice
from .progress import Progress
from .text import counted

#: Numbers in a table above which several processes pay: about three seconds of work for one.
LONG_TABLE = 300_000
#: The same with compiled models: about two seconds, of which another process takes half a second to start.
LONG_FOR_COMPILED = 3_000_000


class Observer(Protocol):
    """What watches the results of a pass, block by block, and says at the end what it saw."""

    def add(self, done: Rows) -> None:
        """Add a block."""
        ...

    def show(self, layout: Layout, left: Departures, quiet: bool) -> None:
        """Print what was seen, and the limits that joints leave; on standard error only if not `quiet`."""
        ...


class Plan(NamedTuple):
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
    engine: Engine
    remarks: Sequence[str]


class Tables(NamedTuple):
    """The files of a command, and its options for them.

    Attributes:
        source: The table that is read.
        output: File of the result, or None for standard output.
        reactions: File of the reactions, or None.
        jobs: Number of processes, or None for the command's own choice.
        quiet: Whether the summary is left out.
        plot: File of a figure of the result, or None.
    """

    source: str
    output: str | None
    reactions: str | None
    jobs: int | None
    quiet: bool
    plot: str | None


def for_each_table(compute: Callable[..., int], words: dict[str, Any], *, report: bool = False) -> int:
    """Compute a table, or each of several ones, and return the exit status.

    Args:
        compute: Function of `tables`, the files, and the other values, that computes a table.
        words: Values of arguments and options.
        report: Whether the result is no table but a report, .csv or .json.
    """
    resume = words.pop("resume")
    if several(words["source"]):
        from .batch import compute_each

        return compute_each(compute, words, ".csv" if report else "", resume=resume)
    if resume:
        raise click.UsageError("--resume belongs to several tables")
    (report_file if report else result_file)(click.get_current_context(), None, words["output"])
    return one_table(compute, words)


def one_table(compute: Callable[..., int], words: dict[str, Any]) -> int:
    """Check the files of one table, and compute it."""
    tables = Tables(**{name: words.pop(name) for name in Tables._fields})
    check_targets([tables.source], (tables.output, tables.reactions))
    if tables.reactions == "-" and tables.output in (None, "-"):
        raise click.UsageError("efforts and reactions cannot both go to standard output")
    return compute(tables=tables, **words)


def run(
    tables: Tables,
    load: RobotChoice,
    plan: Callable[[Pass], Plan],
    *,
    outputs: Sequence[str] = (),
    efforts: bool = False,
) -> Departures:
    """Read a table, compute block by block, write the result and print the summary.

    Args:
        plan: Function of the pass that returns the computation.
        outputs: Output joints, as for `Pass`.
        efforts: Whether the table has efforts.

    Returns:
        The limits that joints leave.

    Raises:
        HybridynError: A file or a row is wrong; no file is written then.
    """
    keep_freed_memory()
    started = time.perf_counter()
    with contextlib.ExitStack() as opened:
        table = opened.enter_context(open_table(tables.source))
        given = Pass(load(), table, outputs=outputs, efforts=efforts)
        planned = plan(given)
        models = planned.engine.model
        workers = opened.enter_context(Workers(_processes(tables.jobs, table, models is not None)))
        done_by = given.blocks(planned.model, None if models is None else models.assemble, workers)
        loaded, samples, left = time.perf_counter(), 0, Departures()
        observers = [*planned.observers]
        if tables.plot and planned.columns is not None:
            from .drawing import Drawing

            observers.insert(0, Drawing(given.robot, table, planned.columns, tables.plot))
        with _writer(tables, given, planned.columns) as write, Progress() as progress:
            for done in done_by:
                left.add(done.left, done.first_row, done.time)
                planned.engine.handed_over += done.handed_over
                for observer in observers:
                    observer.add(done)
                write(done)
                samples += len(done.rows)
                progress.show(samples, min(samples / table.rows, 1.0) if table.rows else None)
    finished = time.perf_counter()
    for observer in observers:
        observer.show(given.layout, left, tables.quiet)
    if not tables.quiet:
        shared = f" in {workers.count} processes" if workers.count > 1 else ""
        speed = f"{samples / max(finished - loaded, 1e-9):,.0f} samples/s{shared}"
        lines = [*planned.remarks, str(planned.engine)]
        lines.append(f"{counted(samples, 'sample')}, {speed}, wall time {finished - started:.2f} s")
        lines += shared_wrenches(given.robot) if tables.reactions else []
        click.echo("\n".join(lines), err=True)
    return left


def _processes(jobs: int | None, table: Table, compiled: bool) -> int:
    """Return the number of processes to start, 0 to compute in this one."""
    long = LONG_FOR_COMPILED if compiled else LONG_TABLE
    if jobs is None and (table.rows or 0) * len(table.columns) > long:
        from ...studies.sweep.pools import cores

        jobs = cores()
    return 0 if jobs in (None, 1) else jobs


@contextlib.contextmanager
def _writer(tables: Tables, given: Pass, columns: Sequence[str] | None) -> Iterator[Callable[[Rows], None]]:
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

        def write(done: Rows) -> None:
            """Write the rows of a block."""
            for name, to in writes.items():
                rows = getattr(done, name)
                to(rows if done.time is None else np.column_stack([done.time, rows]))

        yield write
