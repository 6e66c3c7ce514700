"""Build a chart from a table of a motion, one panel per quantity and unit.

A table names its joints, but does not state which of them slide and which turn. Where the robot is not known
either, joints that may have different units do not share an axis.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ..errors import TrajectoryError
from ..spatial import Array
from ..tables.signals import UNITS, unit_of
from .motion import MOST_GROUPS, energies, residual
from .panels import Chart, Line, Panel

#: Quantities of a joint that are drawn.
QUANTITIES = ("position", "velocity", "acceleration", "effort")


def chart_of_table(
    columns: Sequence[str], rows: Array, *, title: str = "", kinds: Mapping[str, str] | None = None
) -> Chart:
    """Build a chart of a table of a motion over time, one panel per quantity and unit.

    If the table holds efforts, joints without an effort (passive joints) are omitted for legibility. Joints
    of unknown kind have a panel each.

    Args:
        columns: Names of the columns ("<joint>/effort", "energy/total", ...).
        rows: The rows, shape (T, columns).
        title: Title of the chart.
        kinds: Kind of each joint by name ("prismatic", "revolute", ...), as far as known.

    Raises:
        TrajectoryError: No column can be drawn.
    """
    data = dict(zip(columns, rows.T, strict=True))
    timed = "time" in data
    panels = [panel for part in QUANTITIES for panel in _of_joints(data, part, kinds or {})]
    if len(panels) > MOST_GROUPS:
        left = f"({len(panels) - MOST_GROUPS:,} more panels are not drawn)"
        panels = panels[:MOST_GROUPS]
        panels[-1] = replace(panels[-1], title=f"{panels[-1].title} {left}".lstrip())
    panels += energies(data)
    if not panels:
        raise TrajectoryError("no column of a joint and no energy to draw")
    panels += residual(data)
    x = data["time"] if timed else np.arange(len(rows), dtype=float)
    return Chart(title, x, "time [s]" if timed else "row", tuple(panels))


def joints_of_unknown_unit(columns: Sequence[str], kinds: Mapping[str, str]) -> list[str]:
    """Return the joints that are drawn on an axis each, because their units may differ."""
    names = dict.fromkeys(name for part in QUANTITIES for name in _drawn(columns, part))
    unknown = [name for name in names if name not in kinds]
    return unknown if len(unknown) > 1 else []


def _of_joints(data: Mapping[str, Array], part: str, kinds: Mapping[str, str]) -> list[Panel]:
    """Return the panels of one quantity: joints that slide, joints that turn, and each unknown joint."""
    groups: dict[tuple[str, str], list[Line]] = {}
    names = _drawn([*data], part)
    unknown = [name for name in names if name not in kinds]
    for name in names:
        if name in unknown:
            key = (name if len(unknown) > 1 else "", " or ".join(UNITS[part]))
        else:
            key = ("", unit_of(kinds[name], part))
        groups.setdefault(key, []).append(Line(name, data[f"{name}/{part}"]))
    return [Panel(title, f"{part} [{unit}]", tuple(lines)) for (title, unit), lines in groups.items()]


def _drawn(columns: Sequence[str], part: str) -> list[str]:
    """Return the joints that have a column of one quantity; the motors alone if the table has efforts."""
    motors = {name.partition("/")[0] for name in columns if name.endswith("/effort")}
    ending = f"/{part}"
    names = [name.removesuffix(ending) for name in columns if name.endswith(ending)]
    return [name for name in names if not motors or name in motors]
