"""Charts of the reports of `hybridyn idm`: the loads of motors and joints, and what each effect adds.

A motor's characteristic must enclose the cloud of its speeds and efforts.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..colours import ALARM, GOOD, MODULES, MOTOR
from ..errors import TrajectoryError
from ..spatial import Array
from ..studies.bearings import BEARING_UNITS
from ..studies.sizing import MotorLoad, Sizing
from .panels import Mark, Panel, PanelFigure

if TYPE_CHECKING:
    from ..effects.dc_motors import OnDcMotors

#: Columns of panels: a module of six motors fills a row.
COLUMNS = 6
#: A limit is drawn if it is at most this multiple of the peak. A higher one would shrink the cloud to a dot.
CLOUD_LIMIT_FACTOR = 3.0
#: Points of the line of a DC motor, which has corners where its current ends it.
SUPPLY_POINTS = 201
#: Colour of that line.
GIVEN = MODULES[1]
#: Quantities of the loads of motors: the column of the unit or the unit itself, and the columns of the bars.
LOADS = {
    "effort": ("effort_unit", {"peak": "peak_effort", "RMS": "rms_effort"}),
    "speed": ("speed_unit", {"peak": "peak_speed", "RMS": "rms_speed"}),
    "power": ("W", {"peak": "peak_power", "peak of braking": "peak_braking_power"}),
}
#: Quantities of the loads of joints, likewise.
BEARINGS = {
    word: (unit, {"peak": f"peak_{word}", "RMS": f"rms_{word}"}) for word, unit in BEARING_UNITS.items()
}

#: Signs of the two ends of an axis.
ENDS = np.array([-1.0, 1.0])

Value = str | float | None
Row = Mapping[str, Value]


def chart_of_report(rows: Sequence[Row], *, title: str = "") -> PanelFigure:
    """Build a chart of a report, a panel per quantity and unit, bars per motor.

    Args:
        rows: Names and values: with "effect", what effects add to efforts, else loads of motors or joints.
        title: Title of the chart.

    Raises:
        TrajectoryError: The rows are of another kind.
    """
    known = {*rows[0]} if rows else {*()}
    if {"effect", "motor", "rms"} <= known:
        bars = [
            (f"RMS of what it adds [{row['unit']}]", row["effect"], row["motor"], row["rms"]) for row in rows
        ]
    elif {"motor", "peak_effort"} <= known:
        bars = [
            (f"{quantity} [{row.get(unit, unit)}]", name, row["motor"], row[column])
            for quantity, (unit, columns) in LOADS.items()
            for row in rows
            for name, column in columns.items()
        ]
    elif {"joint", "peak_radial"} <= known:
        bars = [
            (f"{quantity} [{unit}]", name, row["joint"], row[column])
            for quantity, (unit, columns) in BEARINGS.items()
            for row in rows
            for name, column in columns.items()
            if row[column] is not None
        ]
    else:
        raise TrajectoryError("there is nothing to draw: neither loads of motors or joints nor effects")
    drawn = _bar_panels(bars)
    return PanelFigure(title, drawn, across=min(len(drawn), 2))


def _bar_panels(bars: Sequence[tuple[str, Value, Value, Value]]) -> list[Panel]:
    """Return the panels of bars, each a label, what it is the size of, the motor or joint, and the size."""
    panels: dict[str, dict[str, dict[str, float]]] = {}  # sizes by label, name and motor; unknown ones are 0
    for label, name, motor, number in bars:
        panels.setdefault(label, {}).setdefault(str(name), {})[str(motor)] = abs(float(number or 0.0))
    return [
        Panel("", label, [
            Mark(name, (*sizes,), np.array([*sizes.values()]), "bar", colour)
            for (name, sizes), colour in zip(named.items(), itertools.cycle(MODULES), strict=False)
        ])
        for label, named in panels.items()
    ]  # fmt: skip


def chart_of_sizing(sizing: Sizing, *, dc: OnDcMotors | None = None, title: str = "") -> PanelFigure:
    """Build a chart, a panel per motor: effort over speed at every sample, RMS effort, peak and limits.

    Args:
        sizing: The loads.
        dc: DC motors, whose torque-speed lines are drawn, too; None where there are none.
        title: Title of the chart.
    """
    loads = sizing.loads()
    panels = [_panel(load, sizing.cloud.points[:, i], i, dc) for i, load in enumerate(loads)]
    return PanelFigure(title, panels, across=min(COLUMNS, max(len(panels), 1)))


def _panel(load: MotorLoad, points: Array, motor: int, dc: OnDcMotors | None) -> Panel:
    """Return the panel of a motor.

    Args:
        points: Speed and effort of its samples, shape (T, 2).
        motor: Its number.
        dc: As in `chart_of_sizing`.
    """
    speed, effort = points.T
    marks = [Mark("samples", speed, effort, "dots", MODULES[0])]
    if len(points):
        at = int(np.argmax(np.abs(effort)))
        marks.append(Mark("peak effort", speed[[at]], effort[[at]], "dot", MOTOR))
    speed_limit, effort_limit = (
        limit if limit <= CLOUD_LIMIT_FACTOR * abs(peak.value) else math.inf
        for limit, peak in ((load.speed_limit, load.speed), (load.effort_limit, load.effort))
    )
    across, up = (  # lines cross the panel
        ENDS * max([*np.abs(values), *(end for end in (limit,) if end < math.inf)], default=1.0)
        for values, limit in ((speed, speed_limit), (effort, effort_limit))
    )
    for sign in ENDS:
        marks.append(Mark("RMS effort", across, np.full(2, sign * load.rms_effort), "dashed", GOOD))
        if effort_limit < math.inf:
            marks.append(Mark("limit", across, np.full(2, sign * effort_limit), "solid", ALARM))
        if speed_limit < math.inf:
            marks.append(Mark("limit", np.full(2, sign * speed_limit), up, "solid", ALARM))
    if dc is not None:
        marks += _given_by_supply(dc, motor, across, CLOUD_LIMIT_FACTOR * np.abs(up).max())
    return Panel(load.motor, f"effort [{load.unit('effort')}]", marks, f"speed [{load.unit('speed')}]")


def _given_by_supply(dc: OnDcMotors, motor: int, across: Array, most: float) -> list[Mark]:
    """Return the lines of what a DC motor gives at most, where they are within the panel.

    Args:
        motor: Number of the motor.
        across: Ends of the speeds, shape (2,).
        most: Largest effort that is drawn.
    """
    marks = []
    for at in np.flatnonzero(dc.motors == motor):
        speed = np.linspace(across[0], across[1], SUPPLY_POINTS)
        for effort in (bound[:, at] for bound in dc.bounds(np.tile(speed[:, None], len(dc.motors)))):
            near = np.abs(effort) <= most
            if near.any():
                marks.append(Mark("DC motor", speed[near], effort[near], "solid", GIVEN))
    return marks
