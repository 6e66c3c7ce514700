"""The summary on standard error: the motors' loads, the effects, the engine and the time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

from .text import aligned_rows, counted

if TYPE_CHECKING:
    from ...effects import Effects
    from ...streams.one_pass import Rows
    from ...structure.robot import HybridRobot
    from ...tables.columns import Layout
    from .engine import Engine


class Summary:
    """Peaks and RMS of columns of the motors and the worst closure residual, accumulated block by block."""

    def __init__(
        self,
        robot: HybridRobot,
        quantity: str,
        units: Sequence[str],
        columns: Sequence[str],
        *,
        remarks: Sequence[str],
        engine: Engine,
    ) -> None:
        """Start an empty summary.

        Args:
            quantity: Quantity of the motors, "effort" or "acceleration": those in the columns are told.
            units: Its unit by motor.
            columns: Names of the columns.
            remarks: Lines at the end of the summary.
            engine: The engine, which counts the samples handed to the general path.
        """
        from ...streams.departures import Departures
        from ...tables.over_time import Means, Peaks

        self.left = Departures()
        self.robot, self.quantity, self.remarks, self.engine = robot, quantity, remarks, engine
        self.residual = 0.0
        place = {name: i for i, name in enumerate(columns)}
        motors = [(name, unit, f"{name}/{quantity}") for name, unit in zip(robot.motors, units, strict=True)]
        motors = [one for one in motors if one[2] in place]
        self.names, self.units = [one[0] for one in motors], [one[1] for one in motors]
        self.at = [place[one[2]] for one in motors]
        self.peaks, self.squares = Peaks(len(self.at)), Means()
        self.timed = True

    @property
    def exceeded(self) -> list[str]:
        """Lines that name the limits that the motion exceeds."""
        return self.left.lines()

    def add(self, done: Rows) -> None:
        """Add a block."""
        import numpy as np

        self.left.add(done.left, done.first_row, done.time)
        self.engine.add(done.handed_over)
        self.residual = max(self.residual, float(done.residual.max(initial=0.0)))
        values, self.timed = done.rows[:, self.at], done.time is not None
        rows = np.arange(done.first_row, done.first_row + len(values), dtype=float)
        self.peaks.add(values, rows if done.time is None else done.time)
        self.squares.add(done.time, values**2)

    def show(self, layout: Layout, quiet: bool) -> None:
        """Print the summary on standard error, if this is not `quiet`."""
        if quiet:
            return
        lines = [f"{self.robot.name}: {counted(len(self.robot.motors), 'motor')}"]
        lines += [f"  {line}" for line in self._lines()]
        lines += [*self.exceeded, *by_rows(layout), *fitted_rates(layout), *self.remarks, str(self.engine)]
        if self.robot.description.closures or self.robot.description.couplings:
            lines.append(f"worst closure residual: {self.residual:.2g} of the module's size")
        click.echo("\n".join(lines), err=True)

    def _lines(self) -> list[str]:
        rows = [["motor", f"peak {self.quantity}", f"RMS {self.quantity}", "unit", "peak at"]]
        for i, square in enumerate(self.squares.mean[: len(self.at)]):
            at = self.peaks.at[i]
            place = f"{at:.6g} s" if self.timed else f"row {at:.0f}"
            peak = f"{self.peaks.value[i]:.6g}"
            rows.append([self.names[i], peak, f"{square**0.5:.6g}", self.units[i], place])
        return aligned_rows(rows, right=(1, 2)) if self.at else []


def effects_line(effects: Effects) -> list[str]:
    """Return one line that names the effects that were on."""
    return [f"effects on: {', '.join(effects.names) or 'none'}; others off"]


def branch_line(robot: HybridRobot, layout: Layout) -> list[str]:
    """Return one line on the branch of the postures, where the table is assembled, or no line."""
    from ...studies.home import branch

    return [] if layout.full_state else branch(robot)


def not_computed(robot: HybridRobot, effects: Effects) -> list[str]:
    """Return one line that names effects of the robot's files that are not computed, or no line."""
    from ...effects.choice import stated_names

    missing = [name for name in stated_names(robot) if name not in effects.names]
    if not missing:
        return []
    return [f"the robot's files state {', '.join(missing)}: not computed; '--effects model' computes all"]


def by_rows(layout: Layout) -> list[str]:
    """Return one line that says what RMS values and means of a table without times are, or no line."""
    return [] if layout.time is not None else ["the table has no times: RMS values are means over its rows"]


def fitted_rates(layout: Layout) -> list[str]:
    """Return the lines that name the rates fitted by a spline."""
    from ...description.names import listed

    groups: dict[tuple[str, ...], list[str]] = {}
    for signal in layout.signals:
        if signal.missing:
            groups.setdefault(signal.missing, []).append(signal.name)
    return [
        f"not in the table, fitted by a quintic spline over time: {' and '.join(missing)} of {listed(names)}"
        for missing, names in groups.items()
    ]
