"""Build a chart from a table of a motion, one panel per quantity; the robot need not be known."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..errors import TrajectoryError
from ..spatial import Array
from ..tables.columns import ENERGIES, RESIDUAL
from .motion import SMALLEST
from .panels import Chart, Line, Panel

QUANTITIES = (
    ("position", "position [m or rad]"),
    ("velocity", "velocity [m/s or rad/s]"),
    ("acceleration", "acceleration [m/s^2 or rad/s^2]"),
    ("effort", "effort [N or N m]"),
)


def chart_of_table(columns: Sequence[str], rows: Array, *, title: str = "") -> Chart:
    """Build a chart of a table of a motion over time, one panel per quantity.

    If the table holds efforts, joints without an effort (passive joints) are omitted for legibility.

    Args:
        columns: Names of the columns ("<joint>/effort", "energy/total", ...).
        rows: The rows, shape (T, columns).
        title: Title of the chart.

    Raises:
        TrajectoryError: No column can be drawn.
    """
    data = dict(zip(columns, rows.T, strict=True))
    timed = "time" in data
    panels = []
    for part, label in QUANTITIES:
        if lines := _of_joints(data, part):
            panels.append(Panel("", label, lines))
    if lines := tuple(Line(name.partition("/")[2], data[name]) for name in ENERGIES if name in data):
        panels.append(Panel("", "energy [J]", lines))
    if not panels:
        raise TrajectoryError("no column of a joint and no energy to draw")
    if RESIDUAL in data:
        line = Line("", np.maximum(data[RESIDUAL], SMALLEST))
        panels.append(Panel("", "residual", (line,), logarithmic=True))
    x = data["time"] if timed else np.arange(len(rows), dtype=float)
    return Chart(title, x, "time [s]" if timed else "row", tuple(panels))


def _of_joints(data: dict[str, Array], part: str) -> tuple[Line, ...]:
    """Return one quantity of every joint, or of the motors alone if the table has efforts."""
    motors = {name.partition("/")[0] for name in data if name.endswith("/effort")}
    ending = f"/{part}"
    found = {name.removesuffix(ending): x for name, x in data.items() if name.endswith(ending)}
    return tuple(Line(name, x) for name, x in found.items() if not motors or name in motors)
