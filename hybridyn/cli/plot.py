"""`hybridyn plot`: a figure of a result or a trajectory."""

from __future__ import annotations

import os

import click

from hybridyn.cli.robot_options import existing_file


def _figure_file(ctx: click.Context, param: click.Parameter, value: str) -> str:
    """Check the ending and the folder of a figure's file."""
    from hybridyn.plot import FORMATS

    if not value.lower().endswith(FORMATS):
        raise click.BadParameter(f"'{value}' must end in {', '.join(FORMATS)}", ctx, param)
    folder = os.path.dirname(value)
    if folder and not os.path.isdir(folder):
        raise click.BadParameter(f"there is no folder '{folder}'", ctx, param)
    return value


@click.command("plot", short_help="A figure of a table: motors, efforts, energies against time.")
@click.argument("table", callback=existing_file)
@click.option(
    "-o",
    "--output",
    metavar="FILE",
    required=True,
    callback=_figure_file,
    help="The figure, .png, .svg or .pdf",
)
def command(table: str, output: str) -> None:
    """Draw TABLE, a result of idm, ddm or simulate, or a trajectory: one panel per quantity, time across.

    Where the table holds efforts, only joints with one (motors) are drawn; energies and the closure residual
    follow.
    """
    import numpy as np

    from hybridyn.description.tables import open_table
    from hybridyn.plot import figure_of_table

    with open_table(table) as source:
        columns = source.columns
        rows = np.vstack([block.values for block in source.blocks])
    figure = figure_of_table(columns, rows, title=os.path.basename(table))
    partial = f"{output}.part{os.path.splitext(output)[1]}"
    try:
        figure.savefig(partial, dpi=120)
        os.replace(partial, output)
    finally:
        if os.path.exists(partial):
            os.unlink(partial)
