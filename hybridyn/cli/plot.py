"""`hybridyn plot`: draw a result or a trajectory."""

from __future__ import annotations

import os

import click

from .common.figures import chart_file, save_chart
from .common.options import existing_file


@click.command("plot", short_help="A figure of a table: motors, efforts, energies against time.")
@click.argument("table", callback=existing_file)
@click.option(
    "-o",
    "--output",
    metavar="FILE",
    required=True,
    callback=chart_file,
    help="File of the figure, .png, .svg or .pdf, or .html for a page to zoom into",
)
def command(table: str, output: str) -> None:
    """Draw TABLE, a result of idm, ddm or simulate, or a trajectory: one panel per quantity, over time.

    Where the table has efforts, only joints with an effort (motors) are drawn; energies and the closure
    residual follow. The option '--plot' of these commands also shows what comes from the robot's files:
    motors grouped by module, limits.
    """
    import numpy as np

    from ..figures.table import chart_of_table
    from ..tables.opening import open_table

    with open_table(table) as source:
        columns = source.columns
        rows = np.vstack([block.values for block in source.blocks])
    save_chart(chart_of_table(columns, rows, title=os.path.basename(table)), output)
