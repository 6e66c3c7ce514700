"""Matplotlib figures of tables and results, created without pyplot, so that no window opens.

The charts are plain data (`panels`). `as_page` writes the same charts as HTML pages that need no network.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from ..spatial import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..structure.robot import HybridRobot


def figure_of_table(
    columns: Sequence[str], rows: Array, *, title: str = "", kinds: Mapping[str, str] | None = None
) -> Figure:
    """Draw a table of a motion over time, one panel per quantity and unit.

    If the table holds efforts, joints without an effort (passive joints) are omitted for legibility. Joints
    of unknown kind have a panel each.

    Args:
        columns: Names of the columns ("<joint>/effort", "energy/total", ...).
        rows: The rows, shape (T, columns).
        title: Title of the figure.
        kinds: Kind of each joint by name, as far as known: `dict(zip(robot.joints, robot.kinds))`.

    Raises:
        TrajectoryError: No column can be drawn.
        HybridynError: matplotlib is missing.
    """
    from .as_matplotlib import figure_of_chart
    from .table import chart_of_table

    return figure_of_chart(chart_of_table(columns, rows, title=title, kinds=kinds))


def figure_of_efforts(robot: HybridRobot, time: Array, tau: Array, *, title: str = "") -> Figure:
    """Draw efforts over time, one panel per module, with limits and peaks marked.

    Args:
        time: Times, shape (T,), [s].
        tau: Efforts, shape (T, motors), [N or N m], as returned by `hybridyn.idm`.
        title: Title of the figure.

    Raises:
        TrajectoryError: The robot has no motors, or there are no samples.
        HybridynError: matplotlib is missing.
    """
    from .as_matplotlib import figure_of_chart
    from .motion import chart_of_rows

    columns = [f"{motor}/effort" for motor in robot.motors]
    return figure_of_chart(chart_of_rows(robot, columns, time, tau, title=title))
