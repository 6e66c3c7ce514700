"""Commands that compute a table from another one, row by row: their options, and the pass over the rows."""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Callable, Collection, Iterator, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import click

from ...streams.workers import Workers, keep_freed_memory
from .batch import compute_each, several
from .figures import Drawing, plot_option
from .files import check_targets, existing_file, report_file, result_file
from .options import Brief, RobotChoice, RobotCommand
from .progress import Progress
from .text import counted

if TYPE_CHECKING:
    from ...streams.one_pass import Model, Pass, Rows
    from ...streams.postures import Assemble
    from ...structure.robot import HybridRobot
    from ...tables.columns import Layout
    from ...tables.opening import Table


#: Numbers in a table above which several processes pay: about three seconds of work for one.
LONG_TABLE = 300_000
#: The same with compiled models: about two seconds, of which another process takes half a second to start.
LONG_FOR_COMPILED = 3_000_000


class Observer(Protocol):
    """What watches the results of a pass, block by block, and says at the end what it saw."""

    @property
    def exceeded(self) -> Sequence[str]:
        """Lines that name the limits that the motion exceeds."""
        ...

    def add(self, done: Rows) -> None:
        """Add a block."""
        ...

    def show(self, layout: Layout, quiet: bool) -> None:
        """Print what was seen; on standard error only if this is not `quiet`."""
        ...


class Plan(NamedTuple):
    """The computation of a command.

    Attributes:
        model: The model to evaluate on each block.
        columns: Columns of the result after the time.
        observers: What watches the results.
        written: Whether the rows are written, and drawn.
        assemble: Assembles the rows; None for the general path.
    """

    model: Model
    columns: Sequence[str]
    observers: Sequence[Observer]
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
    plot: str | None


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


def _source(metavar: str, *, own: bool) -> click.Argument:
    """Return the argument `source`: the table that a command reads, or a folder or a glob of tables."""

    def callback(ctx: click.Context, param: click.Parameter, value: str | None) -> str | None:
        """Check the table, or let several pass."""
        if value is not None and several(value):
            return value
        return (own_table if own else existing_file)(ctx, param, value)

    return click.Argument(
        ["source"],
        metavar=f"[{metavar}]" if own else metavar,
        required=not own,
        callback=callback,
        type=click.Path(),
    )


def jobs_option(default: str) -> Brief:
    """Return the option `--jobs`. `default`: the number of processes where the user gives none."""
    return Brief(
        ["-j", "--jobs"],
        type=click.IntRange(1),
        metavar="N",
        help=f"Processes.  [default: {default}]",
    )


def resume_option(of: str) -> click.Option:
    """Return the option `--resume`. `of`: the beginning of its help."""
    return click.Option(["--resume"], is_flag=True, help=f"{of} Continue an earlier run.".lstrip())


def _table_options(plot: str) -> tuple[click.Option, ...]:
    return (
        click.Option(
            ["-o", "--output"],
            metavar="FILE",
            help="Result; a folder for several tables.  [default: stdout]",
        ),
        click.Option(
            ["--reactions"],
            metavar="FILE",
            callback=result_file,
            help="Write internal wrenches, too, .csv or .parquet.",
        ),
        plot_option(plot, page=True),
        click.Option(["-q", "--quiet"], is_flag=True, help="No summary."),
        jobs_option("1; one per core for long tables"),
        resume_option("Several tables:"),
    )


class TableCommand(RobotCommand):
    """A command that computes a table from another one, or from each of several ones.

    Its function receives `load`, and `tables`, the files.
    """

    def __init__(
        self,
        *,
        metavar: str,
        plot: str,
        params: list[click.Parameter],
        own: bool = False,
        reports: Collection[str] = (),
        **words: Any,
    ) -> None:
        """Add the options of tables.

        Args:
            metavar: Name of the table in the help.
            plot: The content of a figure of the result, for the help.
            params: The command's own options.
            own: Whether a shipped robot's own trajectory is the default.
            reports: Flags with which the result is no table but a report, .csv or .json.
            words: As for `click.Command`.
        """
        self.reports = reports
        super().__init__(params=[_source(metavar, own=own), *params, *_table_options(plot)], **words)

    def run(self, words: dict[str, Any]) -> Any:
        """Call the function, once for each table."""
        resume = words.pop("resume")
        report = any(words[name] for name in self.reports)
        if several(words["source"]):
            return compute_each(self, words, ".csv" if report else "", resume=resume)
        if resume:
            raise click.UsageError("--resume belongs to several tables")
        output = next(one for one in self.params if one.name == "output")
        (report_file if report else result_file)(click.get_current_context(), output, words["output"])
        return self.one(words)

    def one(self, words: dict[str, Any]) -> Any:
        """Check the files of one table, and call the function with them."""
        tables = Tables(**{name: words.pop(name) for name in Tables._fields})
        check_targets([tables.source], (tables.output, tables.reactions))
        if tables.reactions == "-" and tables.output in (None, "-"):
            raise click.UsageError("efforts and reactions cannot both go to standard output")
        assert self.callback is not None
        return self.callback(tables=tables, **words)


def run(
    tables: Tables,
    load: RobotChoice,
    plan: Callable[[Pass], Plan],
    *,
    outputs: Sequence[str] = (),
    efforts: bool = False,
) -> Plan:
    """Read a table, compute block by block, write the result and print the summary.

    Args:
        plan: Function of the pass that returns the computation.
        outputs: Output joints, as for `Pass`.
        efforts: Whether the table has efforts.

    Returns:
        The computation, whose observers have seen all blocks.

    Raises:
        HybridynError: A file or a row is wrong; no file is written then.
    """
    from ...streams.one_pass import Pass
    from ...tables.opening import open_table

    keep_freed_memory()
    started = time.perf_counter()
    with contextlib.ExitStack() as opened:
        table = opened.enter_context(open_table(tables.source))
        given = Pass(load(), table, outputs=outputs, efforts=efforts)
        robot, layout = given.robot, given.layout
        planned = plan(given)
        workers = opened.enter_context(Workers(_processes(tables.jobs, table, planned.assemble is not None)))
        done_by = given.blocks(planned.model, planned.assemble, workers)
        loaded, samples = time.perf_counter(), 0
        observers = [*planned.observers]
        if tables.plot and planned.written:
            title = f"{robot.name}, {os.path.basename(tables.source)}"
            observers.insert(0, Drawing(robot, planned.columns, title, tables.plot, table.rows))
        with _writer(tables, robot, planned, layout.time is not None) as write, Progress() as progress:
            for done in done_by:
                for observer in observers:
                    observer.add(done)
                write(done)
                samples += len(done.rows)
                progress.show(samples, min(samples / table.rows, 1.0) if table.rows else None)
        jobs = max(workers.count, 1)
    finished = time.perf_counter()
    for observer in observers:
        observer.show(layout, tables.quiet)
    if planned.written and not tables.quiet:
        _told(robot, tables, samples, finished - loaded, finished - started, jobs)
    return planned


def _told(robot: HybridRobot, tables: Tables, samples: int, seconds: float, wall: float, jobs: int) -> None:
    """Print how fast the samples were computed, and which reactions are not unique."""
    rate = samples / seconds if seconds > 0 else float("inf")
    shared = f" in {jobs} processes" if jobs > 1 else ""
    lines = [f"{counted(samples, 'sample')}, {rate:,.0f} samples/s{shared}, wall time {wall:.2f} s"]
    if tables.reactions:
        from ...streams.reaction_columns import shared_wrenches

        lines += shared_wrenches(robot)
    click.echo("\n".join(lines), err=True)


def _processes(jobs: int | None, table: Table, compiled: bool) -> int:
    """Return the number of processes to start, 0 to compute in this one."""
    long = LONG_FOR_COMPILED if compiled else LONG_TABLE
    if jobs is None and (table.rows or 0) * len(table.columns) > long:
        from ...studies.sweep.pools import cores

        jobs = cores()
    return 0 if jobs in (None, 1) else jobs


@contextlib.contextmanager
def _writer(tables: Tables, robot: HybridRobot, plan: Plan, timed: bool) -> Iterator[Callable[[Rows], None]]:
    """Yield a function that writes the results of a block; files appear when they are complete."""
    import numpy as np

    from ...tables.results import open_results

    time_column = ["time"] if timed else []
    with contextlib.ExitStack() as files:
        writes = {}
        if plan.written:
            writes["rows"] = files.enter_context(open_results(tables.output, [*time_column, *plan.columns]))
        if tables.reactions:
            from ...streams.reaction_columns import reaction_columns

            columns = [*time_column, *reaction_columns(robot)]
            writes["reactions"] = files.enter_context(open_results(tables.reactions, columns))

        def write(done: Rows) -> None:
            """Write the rows of a block."""
            for name, to in writes.items():
                rows = getattr(done, name)
                to(rows if done.time is None else np.column_stack([done.time, rows]))

        yield write
