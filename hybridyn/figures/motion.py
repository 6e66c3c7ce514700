"""Build a chart of a table of a motion: a panel per quantity, module and unit, then power and energies.

A table names its joints, but does not state which of them slide and which turn. Where the robot is not known
either, each joint has an axis of its own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ..colours import MODULES, module_colour
from ..errors import TrajectoryError
from ..spatial import Array
from ..structure.robot import HybridRobot
from ..tables.columns import ENERGIES, RESIDUAL
from ..tables.signals import UNITS, unit_of
from .panels import Chart, Mark, Panel, with_limits

#: Quantities of a joint that are drawn.
QUANTITIES = ("position", "velocity", "acceleration", "effort")
#: Largest number of panels of joints that stays legible in a figure.
MOST_PANELS = 60
#: Value drawn for an exact zero on a logarithmic axis.
SMALLEST = 1e-17
#: Number of modules whose power is drawn.
MOST_POWERS = 9
#: Samples, or pairs of extremes, of which a chart consists at most. A figure has fewer pixels.
MOST_SAMPLES = 4000

Data = Mapping[str, Array]


def extremes(x: Array, rows: Array, each: int) -> tuple[Array, Array]:
    """Replace consecutive rows by their least and largest values, so that no peak is lost.

    Args:
        x: Times or numbers of the rows, shape (T,).
        rows: The rows, shape (T, columns).
        each: Number of rows that become two; 1 leaves all as they are.
    """
    if each == 1:
        return x, rows
    first = np.arange(0, len(x), each)
    both = np.stack([np.minimum.reduceat(rows, first), np.maximum.reduceat(rows, first)], axis=1)
    return np.repeat(x[first], 2), both.reshape(-1, rows.shape[1])


def chart_of_rows(
    columns: Sequence[str],
    x: Array,
    rows: Array,
    *,
    robot: HybridRobot | None = None,
    timed: bool = True,
    title: str = "",
) -> Chart:
    """Build a chart of a table over time.

    If the table holds efforts, only joints with an effort (motors) are drawn.

    Args:
        columns: Names of the columns ("<joint>/effort", "energy/total", ...).
        x: Times [s], or numbers of rows, shape (T,).
        rows: The rows, shape (T, columns).
        robot: The robot, whose modules have a panel each, with limits; None where it is not known.
        timed: Whether `x` is time.
        title: Title of the chart.

    Raises:
        TrajectoryError: No column can be drawn.
    """
    x, rows = extremes(x, rows, max(1, len(x) // MOST_SAMPLES))
    data = dict(zip(columns, rows.T, strict=True))
    panels = [panel for quantity in QUANTITIES for panel in _of_joints(robot, x, data, quantity)]
    if (left := len(panels) - MOST_PANELS) > 0:
        last = panels[MOST_PANELS - 1]
        panels = panels[: MOST_PANELS - 1]
        panels.append(replace(last, title=f"{last.title} ({left:,} more panels are not drawn)"))
    panels += [*_power(robot, x, data), *_energies(x, data)]
    if not panels or not len(x):
        raise TrajectoryError("there is nothing to draw: no column of a joint and no energy")
    if RESIDUAL in data:
        y = np.maximum(data[RESIDUAL], SMALLEST)
        marks = [Mark("", x, y, "solid", MODULES[0])]
        title_ = "closures: how far open, over the module's size"
        panels.append(Panel(title_, RESIDUAL, marks, logarithmic=True))
    return Chart(title, panels, "time [s]" if timed else "row")


def _of_joints(robot: HybridRobot | None, x: Array, data: Data, quantity: str) -> list[Panel]:
    """Return the panels of one quantity, one per module or run of joints in series, and unit."""
    places = {} if robot is None else _places(robot)
    motors = {name.removesuffix("/effort") for name in data if name.endswith("/effort")}
    groups: dict[tuple[str, str, str], list[str]] = {}
    for column in data:
        name = column.removesuffix(f"/{quantity}")
        if name == column or (motors and name not in motors):
            continue
        place, unit = (name, "#222222"), " or ".join(UNITS[quantity])
        if robot is not None and name in places:
            place, unit = places[name], unit_of(robot.records[name].kind, quantity)
        groups.setdefault((*place, unit), []).append(name)
    panels = []
    for (title, colour, unit), names in groups.items():
        limits = [
            robot.records[name].effort_limit if robot and name in places and quantity == "effort" else np.inf
            for name in names
        ]
        lines = {name: data[f"{name}/{quantity}"] for name in names}
        panels.append(with_limits(title, f"{quantity} [{unit}]", x, lines, limits, unit, colour))
    return panels


def _places(robot: HybridRobot) -> dict[str, tuple[str, str]]:
    """Return the title and colour of each joint's panel: its module, or its run of joints in series."""
    runs: list[list[int]] = []
    for number, module in enumerate(robot.modules):
        before = runs[-1][-1] if runs else -1
        serial = runs and module.parent == before and not robot.modules[before].closures
        if serial and not module.closures:
            runs[-1].append(number)
        else:
            runs.append([number])
    out: dict[str, tuple[str, str]] = {}
    for run in runs:
        ends = dict.fromkeys(robot.modules[number].name for number in (run[0], run[-1]))
        place = " ... ".join(ends), module_colour(run[0])
        out |= {j: place for k in run for j in robot.modules[k].joints if j in robot.records}
    return out


def _power(robot: HybridRobot | None, x: Array, data: Data) -> list[Panel]:
    """Return a panel of the motor power per module, if the rows hold the rates of the motors."""
    powers: dict[str, Array] = {}
    for module in robot.modules if robot else ():
        pairs = [(f"{motor}/effort", f"{motor}/velocity") for motor in module.motors]
        if pairs and all(name in data for pair in pairs for name in pair):
            powers[module.name] = np.sum([data[a] * data[b] for a, b in pairs], axis=0)
    if len(powers) > 1:
        some = list(powers.items())[:MOST_POWERS]
        powers = {"all motors": np.sum(list(powers.values()), axis=0), **dict(some)}
    return [_lines("power of the motors", "power [W]", x, powers)] if powers else []


def _energies(x: Array, data: Data) -> list[Panel]:
    """Return a panel of the energies, if a table has them."""
    lines = {name.partition("/")[2]: data[name] for name in ENERGIES if name in data}
    return [_lines("energy", "energy [J]", x, lines)] if lines else []


def _lines(title: str, label: str, x: Array, lines: Data) -> Panel:
    """Return a panel of lines."""
    colours = [MODULES[number % len(MODULES)] for number in range(len(lines))]
    marks = [Mark(name, x, y, "solid", own) for (name, y), own in zip(lines.items(), colours, strict=True)]
    return Panel(title, label, marks)
