"""The closing summary on standard error: what the motors had to do, and how the numbers came about."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from hybridyn.description.columns import Layout
    from hybridyn.description.records import Array
    from hybridyn.robot import HybridRobot


def effort_units(robot: HybridRobot) -> list[str]:
    """Give the unit of each motor's effort: N for a prismatic joint, N m for any other."""
    kinds = {joint.name: joint.kind for joint in robot.description.joints}
    return ["N" if kinds[name] == "prismatic" else "N m" for name in robot.motors]


class EffortSummary:
    """Peak and RMS efforts and the worst closure residual, gathered block by block."""

    def __init__(self, robot: HybridRobot) -> None:
        """Start with nothing gathered.

        Args:
            robot: The robot.
        """
        self.robot = robot
        self.samples = 0
        self.residual = 0.0
        self.peaks = [0.0] * len(robot.motors)
        self.places = [""] * len(robot.motors)
        self.squares = [0.0] * len(robot.motors)

    def add(self, tau: Array, residual: Array, time: Array | None, first_row: int) -> None:
        """Take in a block.

        Args:
            tau: Efforts, shape (T, motors), [N or N m].
            residual: Relative closure residuals, shape (T,).
            time: Times, shape (T,), [s], or None.
            first_row: Number of the block's first row in the table.
        """
        self.samples += len(tau)
        self.residual = max(self.residual, float(residual.max(initial=0.0)))
        for motor, efforts in enumerate(tau.T):
            index = int(abs(efforts).argmax())
            if not self.places[motor] or abs(efforts[index]) > abs(self.peaks[motor]):
                self.peaks[motor] = float(efforts[index])
                self.places[motor] = f"row {first_row + index}" if time is None else f"{time[index]:.6g} s"
            self.squares[motor] += float(efforts @ efforts)

    def show(self, layout: Layout, seconds: float, wall: float) -> None:
        """Print the summary on standard error.

        Args:
            layout: The meaning of the table's columns.
            seconds: Time spent on the samples [s].
            wall: Time since the command started [s].
        """
        click.echo(f"{self.robot.name}: {counted(len(self.robot.motors), 'motor')}", err=True)
        rows = [["motor", "peak effort", "RMS effort", "unit", "peak at"]]
        units = effort_units(self.robot)
        for motor, name in enumerate(self.robot.motors):
            rms = (self.squares[motor] / self.samples) ** 0.5
            peak, place = self.peaks[motor], self.places[motor]
            rows.append([name, f"{peak:.6g}", f"{rms:.6g}", units[motor], place])
        for line in aligned_rows(rows, right=(1, 2)):
            click.echo(f"  {line}", err=True)
        for line in fitted_rates(layout):
            click.echo(line, err=True)
        if self.robot.description.closures or self.robot.description.couplings:
            click.echo(f"worst closure residual: {self.residual:.2g} of the module's size", err=True)
        rate = self.samples / seconds if seconds > 0 else float("inf")
        click.echo(
            f"{counted(self.samples, 'sample')}, {rate:,.0f} samples/s, wall time {wall:.2f} s", err=True
        )


def fitted_rates(layout: Layout) -> list[str]:
    """Say which rates the table did not give and a spline did.

    Args:
        layout: The meaning of the table's columns.

    Returns:
        One line per kind of missing rates.
    """
    from hybridyn.description.names import listed

    groups: dict[tuple[str, ...], list[str]] = {}
    for signal in layout.signals:
        if signal.missing:
            groups.setdefault(signal.missing, []).append(signal.name)
    return [
        f"not in the table, fitted by a quintic spline over time: {' and '.join(missing)} of {listed(names)}"
        for missing, names in groups.items()
    ]


def aligned_rows(rows: Sequence[Sequence[str]], right: Sequence[int] = ()) -> list[str]:
    """Set cells in columns.

    Args:
        rows: Cells by row.
        right: Columns that are flush right.

    Returns:
        One line per row.
    """
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = []
    for row in rows:
        cells = [
            cell.rjust(width) if column in right else cell.ljust(width)
            for column, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        lines.append("  ".join(cells).rstrip())
    return lines


def counted(number: int, thing: str) -> str:
    """Give "1 motor", "1,000 motors"."""
    return f"{number:,} {thing}" + ("" if number == 1 else "s")
