"""`hybridyn plot`: draw what a command wrote."""

import os
from typing import Any

import click
import numpy as np

from ..figures.motion import chart_of_rows
from ..figures.panels import PanelFigure
from ..figures.reports import chart_of_report
from ..figures.workspace import figure_of_workspace
from ..structure.robot import HybridRobot
from ..tables.opening import Table, open_table
from .common.figures import FORMATS, save
from .common.files import ends_in, read_report
from .common.options import RobotChoice


def run(table: str, output: str, robot: str | None, **files: Any) -> None:
    """Draw a table, a report or a sweep."""
    title = os.path.basename(table)
    if os.path.isdir(table):
        from ..figures.sweep import chart_of_sweep  # it needs more than the others

        save(chart_of_sweep(table), output)
    elif report := read_report(table):
        save(chart_of_report(report, title=title), output)
    else:
        loaded = RobotChoice(robot, **files)() if robot else None
        with open_table(table) as source:
            drawn = _of_table(source, title, loaded)
        if not isinstance(drawn, PanelFigure):
            ends_in(*FORMATS)(click.get_current_context(), None, output)
        save(drawn, output)


def _of_table(source: Table, title: str, robot: HybridRobot | None) -> Any:
    """Draw a workspace as maps, and all other tables over time."""
    columns = source.columns
    rows = np.vstack([block.values for block in source.blocks])
    data = dict(zip(columns, rows.T, strict=True))
    if "conditioning" in columns:
        poses = {name.rpartition("/")[2]: x for name, x in data.items() if "/pose/" in name}
        return figure_of_workspace(poses, data, title=title)
    timed = "time" in data
    x = data["time"] if timed else np.arange(1.0, len(rows) + 1)
    return chart_of_rows(columns, x, rows, robot=robot, timed=timed, title=title)
