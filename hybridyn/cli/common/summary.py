"""What a command tells of its table: peaks and RMS values, a chart, lines on rates, branch and effects."""

from collections.abc import Sequence

import click
import numpy as np

from ...description.names import listed
from ...effects import Effects
from ...effects.choice import names_on, stated_names
from ...spatial import Array
from ...streams.departures import Departures
from ...streams.one_pass import BlockResults
from ...structure.robot import HybridRobot
from ...studies.branch import branch
from ...tables.layout import Layout
from ...tables.opening import Table
from ...tables.over_time import Means, Peaks, places
from .figures import save, title_of
from .text import aligned_rows, counted


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
        self.peaks.add(values, places(done.time, done.first_row, len(values)))
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
        at = places(done.time, done.first_row, len(done.rows))
        self.parts.append(extremes(at, done.rows, each))

    def show(self, layout: Layout, left: Departures, quiet: bool) -> None:
        """Write the chart."""
        from ...figures.motion import chart_of_rows

        x, rows = map(np.concatenate, zip(*self.parts, strict=True))
        timed, title = layout.time is not None, title_of(self.robot, self.table.file)
        chart = chart_of_rows(self.columns, x, rows, robot=self.robot, timed=timed, title=title)
        save(chart, self.target)


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
    if effects.dc is not None and (bare := effects.dc.without_gears(robot)):
        lines.append(f"no gear ratio is stated for {listed(bare)}: these DC motors turn as their joints do")
    left = ", ".join(name for name in stated_names(robot) if name not in effects.names)
    if left:
        lines.append(f"the robot's files state {left}: not computed; '--effects model' computes all")
    return lines
