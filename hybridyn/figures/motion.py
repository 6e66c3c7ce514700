"""Build a chart of a table of a motion: a panel per quantity, module and unit, then energies.

A table names its joints, but does not state which of them slide and which turn. Where the robot is not known
either, each joint has an axis of its own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ..colours import ALARM, MODULES, module_colour
from ..errors import TrajectoryError
from ..spatial import Array
from ..structure.robot import HybridRobot
from ..tables.columns import ENERGIES, RESIDUAL
from ..tables.signals import UNITS, unit_of
from .panels import Mark, Panel, PanelFigure

#: Quantities of a joint that are drawn.
QUANTITIES = ("position", "velocity", "acceleration", "effort")
#: Largest number of panels of joints that stays legible in a figure.
MOST_PANELS = 60
#: Value drawn for an exact zero on a logarithmic axis.
SMALLEST = 1e-17
#: A limit is drawn if the largest value is within this factor of it.
LIMIT_FACTOR = 2.5
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
    columns: Sequence[str], x: Array, rows: Array, *, robot: HybridRobot | None = None, timed: bool = True,
    title: str = "",
) -> PanelFigure:  # fmt: skip
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
    if len(panels) > MOST_PANELS:
        title += f" (the first {MOST_PANELS} of {len(panels):,} panels)"
        panels = panels[:MOST_PANELS]
    energies = [
        Mark(name.partition("/")[2], x, data[name], "solid", colour)
        for name, colour in zip(ENERGIES, MODULES, strict=False)
        if name in data
    ]
    if energies:
        panels.append(Panel("energy", "energy [J]", energies))
    if not panels or not len(x):
        raise TrajectoryError("there is nothing to draw: no column of a joint and no energy")
    if RESIDUAL in data:
        marks = [Mark("", x, np.maximum(data[RESIDUAL], SMALLEST), "solid", MODULES[0])]
        what = "closures: how far open, over the module's size"
        panels.append(Panel(what, RESIDUAL, marks, logarithmic="y"))
    return PanelFigure(title, panels, "time [s]" if timed else "row")


def _of_joints(robot: HybridRobot | None, x: Array, data: Data, quantity: str) -> list[Panel]:
    """Return the panels of one quantity, one per module or run of joints in series, and unit."""
    records, places = ({}, {}) if robot is None else (robot.records, _places(robot))
    motors = {name.removesuffix("/effort") for name in data if name.endswith("/effort")}
    groups: dict[tuple[str, str, str], list[str]] = {}
    for column in data:
        name = column.removesuffix(f"/{quantity}")
        if name == column or (motors and name not in motors):
            continue
        place, unit = (name, "#222222"), " or ".join(UNITS[quantity])
        if name in places:
            place, unit = places[name], unit_of(records[name].kind, quantity)
        groups.setdefault((*place, unit), []).append(name)
    panels = []
    for (title, colour, unit), names in groups.items():
        marks = []
        for number, name in enumerate(names):
            y, own = data[f"{name}/{quantity}"], MODULES[number % len(MODULES)]
            at = int(np.abs(y).argmax())
            marks.append(Mark(f"{name}, peak {y[at]:.4g}", x, y, "solid", own))
            marks.append(Mark("", x[[at]], y[[at]], "dot", own))
            limit = records[name].effort_limit if quantity == "effort" and name in places else np.inf
            if limit <= LIMIT_FACTOR * abs(y[at]):
                marks += [Mark("", x[[0, -1]], np.full(2, end), "dashed", ALARM) for end in (-limit, limit)]
        panels.append(Panel(title, f"{quantity} [{unit}]", marks, colour=colour))
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
