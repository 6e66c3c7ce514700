"""Commands that compute a table from another one, row by row: their options, and the loop over blocks."""

from __future__ import annotations

import contextlib
import functools
import os
import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import click

from ...streams.blocks import LONG_FOR_COMPILED, LONG_TABLE, Model, Work, blocks, in_order, rows_at_once
from ...streams.memory import keep_freed_memory
from ...streams.postures import Assemble
from ...streams.workers import Workers
from .batch import several, takes_many
from .figures import Drawing, takes_plot
from .files import check_targets, complete_data, existing_file, result_file
from .progress import Progress

if TYPE_CHECKING:
    from ...streams.blocks import Done
    from ...structure.robot import HybridRobot
    from ...tables.columns import Layout
    from ...tables.results import Write
    from ...tables.table import Table


class Gathered(Protocol):
    """A summary that accumulates blocks, and is printed at the end."""

    samples: int

    def add(self, done: Done) -> None:
        """Add a block."""
        ...

    def show(self, layout: Layout, seconds: float, wall: float, jobs: int) -> None:
        """Print the summary, with the seconds spent on samples and in all, and the number of processes."""
        ...


class Plan(NamedTuple):
    """The computation of a command.

    Attributes:
        model: The model to evaluate on each block.
        columns: Columns of the result after the time.
        summary: The summary of the results.
        written: Whether the rows are written.
        assemble: Assembles the rows; None for the general path.
    """

    model: Model
    columns: Sequence[str]
    summary: Gathered
    written: bool = True
    assemble: Assemble | None = None


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
    plot: str | None = None


def own_table(ctx: click.Context, param: click.Parameter, value: str | None) -> str:
    """Return the table that the user names, or the trajectory that comes with a shipped robot."""
    if value is not None:
        return existing_file(ctx, param, value)
    from ...description.shipped import own_trajectory

    robot = ctx.params.get("robot")
    table = own_trajectory(robot) if robot else None
    if table is None:
        raise click.MissingParameter(ctx=ctx, param=param, param_hint="'TRAJECTORY'")
    return table


def takes_source(
    metavar: str, *, own: bool, many: bool = False
) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Add an argument to a command, which receives `source`: the table that it reads.

    Args:
        metavar: Name of the table in the help.
        own: Whether a shipped robot's own trajectory is the default.
        many: Whether a folder or a glob may name several tables.
    """
    check = own_table if own else existing_file

    def callback(ctx: click.Context, param: click.Parameter, value: str | None) -> Any:
        """Check the table, or let several pass."""
        if value is not None and many and several(value):
            return value
        return check(ctx, param, value)

    return click.argument(
        "source",
        metavar=f"[{metavar}]" if own else metavar,
        required=not own,
        callback=callback,
        shell_complete=complete_data,
    )


takes_jobs = click.option(
    "-j",
    "--jobs",
    type=click.IntRange(1, 256),
    help="Number of processes.  [default: 1; one per core where the table has more than "
    f"{LONG_TABLE:,} numbers ({LONG_FOR_COMPILED:,} with compiled models), or there are several]",
)


def takes_table(
    metavar: str, *, own: bool = False, plot: str = ""
) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Add the options of tables to a command, which receives `tables`.

    Args:
        metavar: Name of the table in the help.
        own: Whether a shipped robot's own trajectory is the default.
        plot: The content of a figure of the result, for the help.
    """
    options = (
        takes_source(metavar, own=own, many=True),
        click.option(
            "-o",
            "--output",
            metavar="FILE",
            help="Result file, .csv or .parquet; of several tables, the folder of their shards.  "
            "[default: CSV on standard output]",
        ),
        click.option(
            "--reactions",
            metavar="FILE",
            callback=result_file,
            help="Also write the internal wrenches, .csv or .parquet: '<root link>/reaction/fx' .. 'mz' of "
            "the ground on the root link; '<module>/reaction/...' of a module's base body on the module, at "
            "the origin and in the axes of this body; '<closure>/wrench/...' of a closure on its successor, "
            "at the successor's closure frame in the axes of the predecessor's; '<coupling>/multiplier'.",
        ),
        takes_jobs,
        takes_plot(plot, page=True),
        click.option("-q", "--quiet", is_flag=True, help="No summary."),
    )

    def decorate(function: Callable[..., Any]) -> Callable[..., Any]:
        """Add the options to a function that takes `tables`."""

        @functools.wraps(function)
        def body(
            source: str,
            output: str | None,
            reactions: str | None,
            jobs: int | None,
            plot: str | None,
            quiet: bool,
            **rest: Any,
        ) -> Any:
            """Check the files, and call the function with them."""
            check_targets([source], (output, reactions))
            if reactions == "-" and output in (None, "-"):
                raise click.UsageError("efforts and reactions cannot both go to standard output")
            return function(tables=Tables(source, output, reactions, jobs, quiet, plot), **rest)

        out = takes_many("", result_file)(body)
        for option in reversed(options):
            out = option(out)
        return out

    return decorate


def run(
    tables: Tables,
    load: Callable[[], HybridRobot],
    plan: Callable[[HybridRobot, Layout, int | None], Plan],
    *,
    efforts: bool = False,
) -> None:
    """Read a table, compute block by block, write the result and print the summary.

    Args:
        load: Function that loads the robot.
        plan: Function of the robot, the table's layout and its approximate number of rows, that returns the
            computation.
        efforts: Whether the table has efforts.

    Raises:
        HybridynError: A file or a row is wrong; no file is written then.
    """
    from ...tables.columns import read_layout
    from ...tables.opening import open_table
    from ...tables.trajectory import read_motions

    keep_freed_memory()
    started = time.perf_counter()
    with contextlib.ExitStack() as opened:
        table = opened.enter_context(open_table(tables.source))
        robot = load()
        layout = read_layout(
            table.columns,
            robot.description,
            motors=robot.motors,
            base=robot.base,
            file=table.file,
            efforts=efforts,
        )
        planned = plan(robot, layout, table.rows)
        compiled = planned.assemble is not None
        workers = opened.enter_context(Workers(_processes(tables.jobs, table, compiled)))
        work = Work(robot, layout, planned.model, planned.assemble)
        workers.prepare(work)
        rows = rows_at_once(robot)
        connected = layout.time is not None and not layout.full_state
        loaded = time.perf_counter()
        given = blocks(read_motions(table, layout), rows, connected)
        drawn = Drawing(tables.plot) if tables.plot else None
        with _writer(tables, robot, planned, layout.time is not None) as write, Progress() as progress:
            for done in in_order(work, given, workers):
                planned.summary.add(done)
                write(done)
                if drawn is not None:
                    drawn.add(done)
                progress.show(planned.summary.samples, table.fraction())
        jobs = len(workers)
    if drawn is not None:
        drawn.save(robot, planned.columns, f"{robot.name}, {os.path.basename(tables.source)}")
    finished = time.perf_counter()
    if not tables.quiet:
        planned.summary.show(layout, finished - loaded, finished - started, max(jobs, 1))
        if tables.reactions:
            from ...streams.reaction_columns import shared_wrenches

            for line in shared_wrenches(robot):
                click.echo(line, err=True)


def _processes(jobs: int | None, table: Table, compiled: bool) -> int:
    """Return the number of processes to start, 0 to compute in this one."""
    long = LONG_FOR_COMPILED if compiled else LONG_TABLE
    if jobs is None:
        cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
        jobs = cores if (table.rows or 0) * len(table.columns) > long else 1
    return 0 if jobs == 1 else jobs


@contextlib.contextmanager
def _writer(tables: Tables, robot: HybridRobot, plan: Plan, timed: bool) -> Any:
    """Yield a function that writes the results of a block; files appear when they are complete."""
    import numpy as np

    from ...tables.results import open_results

    if not plan.written:
        yield lambda done: None
        return
    time_column = ["time"] if timed else []
    with contextlib.ExitStack() as files:
        result: Write = files.enter_context(open_results(tables.output, [*time_column, *plan.columns]))
        inner: Write | None = None
        if tables.reactions:
            from ...streams.reaction_columns import reaction_columns

            columns = [*time_column, *reaction_columns(robot)]
            inner = files.enter_context(open_results(tables.reactions, columns))

        def write(done: Any) -> None:
            """Write the rows of a block."""
            for rows, to in ((done.rows, result), (done.reactions, inner)):
                if to is not None:
                    to(rows if done.time is None else np.column_stack([done.time, rows]))

        yield write
