"""Build a chart from the rows of a result: motors grouped by module, power, energy and residuals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ..colours import module_colour
from ..errors import TrajectoryError
from ..spatial import Array
from ..structure.robot import HybridRobot
from ..tables.columns import ENERGIES, RESIDUAL
from ..tables.signals import unit_of
from .panels import Chart, Line, Panel

#: Largest number of panels of motors that stays legible in a figure.
MOST_GROUPS = 60
#: Value drawn for an exact zero on a logarithmic axis.
SMALLEST = 1e-17


class Group(NamedTuple):
    """Motors drawn in one panel: those of a module or of consecutive serial joints, all with the same unit.

    Attributes:
        title: Name of their module.
        colour: Colour of the module, "#rrggbb".
        unit: Unit of their values.
    """

    title: str
    colour: str
    motors: tuple[str, ...]
    unit: str


def groups(robot: HybridRobot, quantity: str) -> list[Group]:
    """Return the motors grouped by panel. `quantity`: "effort" or "acceleration"."""
    kinds = dict(zip(robot.joints, robot.kinds, strict=True))
    runs: list[list[int]] = []
    for number, module in enumerate(robot.modules):
        if not module.motors:
            continue
        before = runs[-1][-1] if runs else -1
        if runs and module.parent == before and not (module.closures or robot.modules[before].closures):
            runs[-1].append(number)
        else:
            runs.append([number])
    out = []
    for run in runs:
        first, last = robot.modules[run[0]].name, robot.modules[run[-1]].name
        title = first if len(run) == 1 else f"{first} ... {last}"
        motors = [motor for number in run for motor in robot.modules[number].motors]
        of_motor = {motor: unit_of(kinds[motor], quantity) for motor in motors}
        for unit in dict.fromkeys(of_motor.values()):
            same = tuple(motor for motor in motors if of_motor[motor] == unit)
            out.append(Group(title, module_colour(run[0]), same, unit))
    return out


def chart_of_rows(
    robot: HybridRobot, columns: Sequence[str], x: Array, rows: Array, *, timed: bool = True, title: str = ""
) -> Chart:
    """Build a chart of the rows of a result of `idm`, `ddm` or `simulate`.

    Args:
        columns: Names of the columns.
        x: Times [s], or numbers of rows, shape (T,).
        rows: The rows, shape (T, columns).
        timed: Whether `x` is time.
        title: Title of the chart.

    Raises:
        TrajectoryError: No column can be drawn.
    """
    data = dict(zip(columns, rows.T, strict=True))
    quantity = "effort" if any(f"{motor}/effort" in data for motor in robot.motors) else "acceleration"
    panels = _motor_panels(robot, data, quantity)
    if quantity == "effort":
        panels += _power(robot, data)
    panels += [*energies(data), *residual(data)]
    if not panels or not len(x):
        raise TrajectoryError("there is nothing to draw: no motor, no energy")
    return Chart(title, x, "time [s]" if timed else "row", tuple(panels))


def _motor_panels(robot: HybridRobot, data: dict[str, Array], quantity: str) -> list[Panel]:
    limits = {m: robot.records[m].effort_limit if quantity == "effort" else np.inf for m in robot.motors}
    panels = []
    every = groups(robot, quantity)
    for number, group in enumerate(every[:MOST_GROUPS], start=1):
        lines = tuple(
            Line(motor, data[column], limits[motor], mark_peak=True)
            for motor in group.motors
            if (column := f"{motor}/{quantity}") in data
        )
        if lines:
            left = f" ({len(every) - number:,} more groups are not drawn)"
            title = group.title + (left if number == MOST_GROUPS < len(every) else "")
            panels.append(Panel(title, f"{quantity} [{group.unit}]", lines, group.colour, group.unit))
    return panels


def _power(robot: HybridRobot, data: dict[str, Array]) -> list[Panel]:
    """Return a panel of the motor power per module, if the rows hold the rates of the motors."""
    lines = []
    for module in robot.modules:
        pairs = [(f"{motor}/effort", f"{motor}/velocity") for motor in module.motors]
        if pairs and all(name in data for pair in pairs for name in pair):
            lines.append(Line(module.name, np.sum([data[a] * data[b] for a, b in pairs], axis=0)))
    if not lines:
        return []
    if len(lines) > 1:
        lines = [Line("all motors", np.sum([line.y for line in lines], axis=0), mark_peak=True), *lines[:9]]
    return [Panel("power of the motors", "power [W]", tuple(lines), unit="W")]


def energies(data: Mapping[str, Array]) -> list[Panel]:
    """Return a panel of the energies, if a table has them."""
    lines = tuple(Line(name.partition("/")[2], data[name]) for name in ENERGIES if name in data)
    return [Panel("energy", "energy [J]", lines, unit="J")] if lines else []


def residual(data: Mapping[str, Array]) -> list[Panel]:
    """Return a panel of the closure residual, if a table has it."""
    if RESIDUAL not in data:
        return []
    line = Line("residual", np.maximum(data[RESIDUAL], SMALLEST))
    return [Panel("closures: how far open, over the module's size", "residual", (line,), logarithmic=True)]
