"""Speed-effort cloud of every motor with its limits; a motor's characteristic must enclose it."""

from __future__ import annotations

import math

import numpy as np

from ..colours import ALARM, GOOD, MODULES, MOTOR
from ..spatial import Array
from ..studies.sizing import MotorLoad, Sizing
from .panels import Chart, Mark, Panel

#: Columns of panels: a module of six motors fills a row.
COLUMNS = 6
#: A limit is drawn if it is at most this multiple of the peak. A higher one would shrink the cloud to a dot.
CLOUD_LIMIT_FACTOR = 3.0


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
