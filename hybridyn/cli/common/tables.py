"""Commands that compute a table from another one, row by row: their files, the pass, what is told of it."""

import contextlib
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple, Protocol

import click
import numpy as np

from ...description.names import listed
from ...effects import Effects
from ...effects.choice import names_on, stated_names
from ...spatial import Array
from ...streams.departures import Departures
from ...streams.one_pass import BlockResults, Model, Pass
from ...streams.reaction_columns import reaction_columns, shared_wrenches
from ...streams.workers import Workers, keep_freed_memory
from ...structure.robot import HybridRobot
from ...studies.home import branch
from ...tables.columns import Layout
from ...tables.opening import Table, open_table
from ...tables.over_time import Means, Peaks
from ...tables.results import open_results
from .engine_choice import EngineChoice
from .figures import save, title_of
from .files import check_targets, report_file, result_file, several
from .options import RobotChoice, refuse
from .progress import progress
from .text import aligned_rows, counted

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


class CommandTables(NamedTuple):
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
    refuse((resume, "--resume belongs to several tables"))
    (report_file if report else result_file)(click.get_current_context(), None, words["output"])
    return one_table(compute, words)


def one_table(compute: Callable[..., int], words: dict[str, Any]) -> int:
    """Check the files of one table, and compute it."""
    tables = CommandTables(**{name: words.pop(name) for name in CommandTables._fields})
    check_targets([tables.source], (tables.output, tables.reactions))
    refuse(
        (
            tables.reactions == "-" and tables.output in (None, "-"),
            "efforts and reactions cannot both go to standard output",
        )
    )
    return compute(tables=tables, **words)


def run(
    tables: CommandTables,
    load: RobotChoice,
    plan: Callable[[Pass], CommandPlan],
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
            observers.insert(0, Drawing(given.robot, table, planned.columns, tables.plot))
        with _writer(tables, given, planned.columns) as write, progress() as show:
            for done in done_by:
                left.add(done.left, done.first_row, done.time)
                planned.engine.handed_over += done.handed_over
                for observer in observers:
                    observer.add(done)
                write(done)
                samples += len(done.rows)
                show(samples, min(samples / table.rows, 1.0) if table.rows else None)
    finished = time.perf_counter()
    for observer in observers:
        observer.show(given.layout, left, tables.quiet)
    if not tables.quiet:
        shared = f" in {workers.count} processes" if workers.count > 1 else ""
        speed = f"{samples / max(finished - loaded, 1e-9):,.0f} samples/s{shared}"
        lines = [*map(str, given.left), *planned.remarks, str(planned.engine)]
        lines.append(f"{counted(samples, 'sample')}, {speed}, wall time {finished - started:.2f} s")
        lines += shared_wrenches(given.robot) if tables.reactions else []
        click.echo("\n".join(lines), err=True)
    return left


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


class Summary:
    """Peaks and RMS of columns of the motors and the worst closure residual, accumulated block by block."""

    def __init__(
        self,
        robot: HybridRobot,
        quantity: str,
        units: Sequence[str],
        columns: Sequence[str],
    ) -> None:
        """Start an empty summary.

        Args:
            quantity: Quantity of the motors, "effort" or "acceleration": those in the columns are told.
            units: Its unit by motor.
            columns: Names of the columns.
        """
        self.robot, self.quantity = robot, quantity
        self.residual, self.squares = 0.0, Means()
        place = {name: i for i, name in enumerate(columns)}
        units_of = dict(zip(robot.motors, units, strict=True))
        self.units = {name: unit for name, unit in units_of.items() if f"{name}/{quantity}" in place}
        self.at = [place[f"{name}/{quantity}"] for name in self.units]
        self.peaks = Peaks(len(self.at))

    def add(self, done: BlockResults) -> None:
        """Add a block."""
        self.residual = max(self.residual, float(done.residual.max(initial=0.0)))
        values = done.rows[:, self.at]
        self.peaks.add(values, _places(done))
        self.squares.add(done.time, values**2)

    def show(self, layout: Layout, left: Departures, quiet: bool) -> None:
        """Print the summary on standard error, if this is not `quiet`."""
        if quiet:
            return
        rows = [["motor", f"peak {self.quantity}", f"RMS {self.quantity}", "unit", "peak at"]]
        for i, (name, unit) in enumerate(self.units.items()):
            at = self.peaks.at[i]
            place = f"row {at:.0f}" if layout.time is None else f"{at:.6g} s"
            rms = self.squares.mean[i] ** 0.5
            rows.append([name, f"{self.peaks.value[i]:.6g}", f"{rms:.6g}", unit, place])
        lines = [f"{self.robot.name}: {counted(len(self.robot.motors), 'motor')}"]
        lines += [f"  {line}" for line in aligned_rows(rows, right=(1, 2)) if self.units]
        lines += left.lines()
        if self.robot.description.closures or self.robot.description.couplings:
            lines.append(f"worst closure residual: {self.residual:.2g} of the module's size")
        click.echo("\n".join(lines), err=True)


class Drawing:
    """A chart of a result over time, which watches the blocks of a pass."""

    def __init__(self, robot: HybridRobot, table: Table, columns: Sequence[str], target: str) -> None:
        """Start without rows.

        Args:
            table: The table from which the result is computed.
            columns: Names of the columns of the rows.
            target: The file, whose ending says its format.
        """
        self.robot, self.table, self.columns, self.target = robot, table, columns, target
        self.parts: list[tuple[Array, Array]] = []

    def add(self, done: BlockResults) -> None:
        """Add a block."""
        from ...figures.motion import MOST_SAMPLES, extremes

        each = max(1, (self.table.rows or 0) // MOST_SAMPLES)
        self.parts.append(extremes(_places(done), done.rows, each))

    def show(self, layout: Layout, left: Departures, quiet: bool) -> None:
        """Write the chart."""
        from ...figures.motion import chart_of_rows

        x, rows = map(np.concatenate, zip(*self.parts, strict=True))
        timed, title = layout.time is not None, title_of(self.robot, self.table.file)
        chart = chart_of_rows(self.columns, x, rows, robot=self.robot, timed=timed, title=title)
        save(chart, self.target)


def _places(done: BlockResults) -> Array:
    """Return the times of the rows of a block, or their numbers where there are no times."""
    if done.time is not None:
        return done.time
    return np.arange(done.first_row, done.first_row + len(done.rows), dtype=float)


def effects_line(robot: HybridRobot, effects: Effects) -> str:
    """Return the line that names the effects that were on."""
    return f"effects on: {names_on(robot, effects)}; others off"


def about(robot: HybridRobot, layout: Layout, effects: Effects) -> list[str]:
    """Return lines on a table: its means, the rates that a spline fits, the branch, the effects."""
    lines = []
    if layout.time is None:
        lines.append("the table has no times: RMS values are means over its rows")
    groups: dict[tuple[str, ...], list[str]] = {}
    for signal in layout.signals:
        groups.setdefault(signal.missing, []).append(signal.name)
    lines += [
        f"not in the table, fitted by a quintic spline over time: {' and '.join(missing)} of {listed(names)}"
        for missing, names in groups.items()
        if missing
    ]
    lines += [*([] if layout.full_state else branch(robot)), effects_line(robot, effects)]
    left = ", ".join(name for name in stated_names(robot) if name not in effects.names)
    if left:
        lines.append(f"the robot's files state {left}: not computed; '--effects model' computes all")
    return lines
