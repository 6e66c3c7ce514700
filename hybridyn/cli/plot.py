"""`hybridyn plot`: draw what a command wrote."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import click

from .common.figures import FORMATS, chart_file, save, save_chart
from .common.files import complete_robot, ends_in, existing_file, read_report, robot_file
from .common.options import PACKAGES, XACRO, Command, RobotChoice

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..figures.panels import Chart
    from ..structure.robot import HybridRobot
    from ..tables.opening import Table


@click.command(
    "plot",
    cls=Command,
    params=[XACRO, PACKAGES],
    short_help="Draw what a command wrote: motions, efforts, loads, workspaces, sweeps.",
)
@click.argument(
    "table",
    callback=lambda ctx, param, value: value if os.path.isdir(value) else existing_file(ctx, param, value),
)
@click.option(
    "-o",
    "--output",
    metavar="FILE",
    required=True,
    callback=chart_file,
    help="File of the figure, .png, .svg or .pdf, or .html for a page to zoom into",
)
@click.option(
    "--robot",
    metavar="ROBOT",
    callback=lambda ctx, param, value: value and robot_file(ctx, param, value),
    shell_complete=complete_robot,
    help="The table's robot, a file or a shipped robot: joints of a module with the same unit share an axis.",
)
@click.pass_context
def command(
    ctx: click.Context,
    table: str,
    output: str,
    robot: str | None,
    xacro_args: dict[str, str],
    package_dirs: tuple[str, ...],
) -> None:
    """Draw TABLE, a file that a command wrote, or the folder of a sweep.

    A trajectory or a result of idm, ddm or simulate is drawn over time, with energies and the closure
    residual. If it contains efforts, only joints with an effort (motors) are drawn. With --robot, as with the
    option '--plot' of these commands, each module has a panel per quantity, with limits; without it, each
    joint has an axis of its own, since the table does not state which joints slide and which turn.

    Loads of motors and effects ('idm --loads', '--by-effect') are bars, a workspace is maps, a sweep shows
    every measure over every parameter.
    """
    from ..tables.opening import open_table

    title = os.path.basename(table)
    report = [] if os.path.isdir(table) else read_report(table)
    drawn: Chart | Figure
    if os.path.isdir(table):
        from ..figures.sweep import chart_of_sweep

        drawn = chart_of_sweep(table)
    elif report:
        from ..figures.reports import chart_of_report

        drawn = chart_of_report(report, title=title)
    else:
        choice = robot and RobotChoice(robot, xacro_args=xacro_args, package_dirs=package_dirs)
        with open_table(table) as source:
            drawn = _of_table(source, title, choice() if choice else None)
    from ..figures.panels import Chart

    if isinstance(drawn, Chart):
        save_chart(drawn, output)
        return
    ends_in(*FORMATS)(ctx, next(one for one in ctx.command.params if one.name == "output"), output)
    save(drawn, output)


def _of_table(source: Table, title: str, robot: HybridRobot | None) -> Chart | Figure:
    """Draw a workspace as maps, and all other tables over time."""
    import numpy as np

    from ..figures.motion import chart_of_rows

    columns = source.columns
    rows = np.vstack([block.values for block in source.blocks])
    data = dict(zip(columns, rows.T, strict=True))
    if "conditioning" in columns:
        from ..figures.workspace import figure_of_workspace

        poses = {name.rpartition("/")[2]: x for name, x in data.items() if "/pose/" in name}
        return figure_of_workspace(poses, data, title=title)
    timed = "time" in data
    x = data["time"] if timed else np.arange(1.0, len(rows) + 1)
    return chart_of_rows(columns, x, rows, robot=robot, timed=timed, title=title)
