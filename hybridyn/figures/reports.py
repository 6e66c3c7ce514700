"""Charts of the reports of `hybridyn idm`: the loads of motors, and what each effect adds.

A motor's characteristic must enclose the cloud of its speeds and efforts.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from ..colours import ALARM, GOOD, MODULES, MOTOR
from ..errors import TrajectoryError
from ..spatial import Array
from ..studies.sizing import MotorLoad, Sizing
from .panels import Chart, Mark, Panel

#: Columns of panels: a module of six motors fills a row.
COLUMNS = 6
#: A limit is drawn if it is at most this multiple of the peak. A higher one would shrink the cloud to a dot.
CLOUD_LIMIT_FACTOR = 3.0
#: Quantities of the loads of motors: the column of the unit or the unit itself, and the columns of the bars.
LOADS = {
    "effort": ("effort_unit", {"peak": "peak_effort", "RMS": "rms_effort"}),
    "speed": ("speed_unit", {"peak": "peak_speed", "RMS": "rms_speed"}),
    "power": ("W", {"peak": "peak_power", "peak of braking": "peak_braking_power"}),
}

Row = Mapping[str, str | float | None]


def chart_of_report(rows: Sequence[Row], *, title: str = "") -> Chart:
    """Build a chart of a report, a panel per quantity and unit, bars per motor.

    Args:
        rows: Names and values: with "effect", what effects add to efforts, else the loads of motors.
        title: Title of the chart.

    Raises:
        TrajectoryError: The rows are of another kind.
    """
    if rows and "effect" in rows[0] and "rms" in rows[0]:
        panels = _of_effects(rows)
    elif rows and "motor" in rows[0] and "peak_effort" in rows[0]:
        panels = [panel for quantity in LOADS for panel in _of_loads(rows, quantity)]
    else:
        raise TrajectoryError("there is nothing to draw: neither loads of motors nor effects")
    return Chart(title, panels, across=min(len(panels), 2))


def _of_loads(rows: Sequence[Row], quantity: str) -> list[Panel]:
    of_unit, columns = LOADS[quantity]
    panels = []
    for unit in dict.fromkeys(row.get(of_unit, of_unit) for row in rows):
        ours = [row for row in rows if row.get(of_unit, of_unit) == unit]
        bars = {name: np.abs(_numbers(ours, column)) for name, column in columns.items()}
        panels.append(_bars(ours, f"{quantity} [{unit}]", bars))
    return panels


def _of_effects(rows: Sequence[Row]) -> list[Panel]:
    panels = []
    for unit in dict.fromkeys(row["unit"] for row in rows):
        ours = [row for row in rows if row["unit"] == unit]
        effects = _names(ours, "effect")
        bars = {name: _numbers([row for row in ours if row["effect"] == name], "rms") for name in effects}
        panels.append(_bars(ours, f"RMS of what it adds [{unit}]", bars))
    return panels


def _bars(rows: Sequence[Row], label: str, bars: dict[str, Array]) -> Panel:
    """Return a panel of bars per motor."""
    motors = _names(rows, "motor")
    marks = [
        Mark(name, motors, y, "bar", MODULES[number % len(MODULES)])
        for number, (name, y) in enumerate(bars.items())
    ]
    return Panel("", label, marks)


def _names(rows: Sequence[Row], column: str) -> tuple[str, ...]:
    return tuple(dict.fromkeys(str(row[column]) for row in rows))


def _numbers(rows: Sequence[Row], column: str) -> Array:
    """Return the numbers of a column; unknown ones are 0."""
    return np.array([float(row[column] or 0.0) for row in rows])


def chart_of_sizing(sizing: Sizing, *, title: str = "") -> Chart:
    """Build a chart, a panel per motor: effort over speed at every sample, RMS effort, peak and limits."""
    loads = sizing.loads()
    panels = [_panel(load, sizing.cloud.points[:, i]) for i, load in enumerate(loads)]
    return Chart(title, panels, across=min(COLUMNS, max(len(panels), 1)))


def _panel(load: MotorLoad, points: Array) -> Panel:
    """Return the panel of a motor. `points`: speed and effort of its samples, shape (T, 2)."""
    speed, effort = points.T
    marks = [Mark("samples", speed, effort, "dots", MODULES[0])]
    if len(points):
        at = int(np.argmax(np.abs(effort)))
        marks.append(Mark("peak effort", speed[[at]], effort[[at]], "dot", MOTOR))
    limits = [
        limit if limit <= CLOUD_LIMIT_FACTOR * abs(peak.value) else math.inf
        for limit, peak in ((load.speed_limit, load.speed), (load.effort_limit, load.effort))
    ]
    right, top = (  # lines cross the panel
        max([*np.abs(values), *(end for end in (limit,) if end < math.inf)], default=1.0)
        for values, limit in zip((speed, effort), limits, strict=True)
    )
    across, up = np.array([-right, right]), np.array([-top, top])
    for sign in (-1.0, 1.0):
        marks.append(Mark("RMS effort", across, np.full(2, sign * load.rms_effort), "dashed", GOOD))
        if limits[1] < math.inf:
            marks.append(Mark("limit", across, np.full(2, sign * limits[1]), "solid", ALARM))
        if limits[0] < math.inf:
            marks.append(Mark("limit", np.full(2, sign * limits[0]), up, "solid", ALARM))
    unit, across_unit = load.unit("effort"), load.unit("speed")
    return Panel(load.motor, f"effort [{unit}]", marks, f"speed [{across_unit}]")
