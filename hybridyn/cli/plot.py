"""`hybridyn plot`: draw a result or a trajectory."""

from __future__ import annotations

import os

import click

from .common.figures import chart_file, save_chart
from .common.files import complete_robot, existing_file, robot_file
from .common.options import PACKAGES, XACRO, Command


@click.command(
    "plot",
    cls=Command,
    params=[XACRO, PACKAGES],
    short_help="Draw a table: motors, efforts, energies over time.",
)
@click.argument("table", callback=existing_file)
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
    help="The table's robot, a file or a shipped robot: joints with the same unit share an axis.",
)
def command(
    table: str, output: str, robot: str | None, xacro_args: dict[str, str], package_dirs: tuple[str, ...]
) -> None:
    """Draw TABLE, a result of idm, ddm or simulate, or a trajectory: one panel per quantity, over time.

    If the table contains efforts, only joints with an effort (motors) are drawn, followed by energies and the
    closure residual. A table does not state which joints are prismatic and which are revolute. Without
    --robot, each joint therefore has an axis of its own. The option '--plot' of these commands also shows
    data of the robot's files: it groups motors by module, and draws limits.
    """
    import numpy as np

    from ..figures.table import chart_of_table, joints_of_unknown_unit
    from ..tables.opening import open_table

    kinds: dict[str, str] = {}
    if robot is not None:
        from ..description import read

        joints = read(robot, xacro_args=xacro_args or None, package_dirs=package_dirs).joints
        kinds = {joint.name: joint.kind for joint in joints}
    with open_table(table) as source:
        columns = source.columns
        rows = np.vstack([block.values for block in source.blocks])
    chart = chart_of_table(columns, rows, title=os.path.basename(table), kinds=kinds)
    if unknown := joints_of_unknown_unit(columns, kinds):
        which = f"'{robot}' has no joint '{unknown[0]}'" if robot else "the table does not state units"
        advice = "" if robot else ": name its robot (--robot) to group joints by unit"
        click.echo(f"note: {which}, so {len(unknown):,} joints have an axis each{advice}", err=True)
    save_chart(chart, output)
