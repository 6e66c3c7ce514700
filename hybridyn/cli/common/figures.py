"""Options that name files of figures, and writing figures to them."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import TYPE_CHECKING

import click

from ...description.writing import appearing, write_text
from ...errors import required
from .files import ends_in

if TYPE_CHECKING:  # completion does without them
    from matplotlib.figure import Figure

    from ...figures.panels import PanelFigure
    from ...structure.robot import HybridRobot

FORMATS = (".png", ".svg", ".pdf")
PAGE = ".html"
DPI = 120


def figure_in(*endings: str) -> Callable[[click.Context, click.Parameter, str | None], str | None]:
    """Return a callback that checks a figure's file, before any work is done.

    It checks the ending, the folder, and that the package for this kind of file is installed.
    """

    def check(ctx: click.Context, param: click.Parameter, value: str | None) -> str | None:
        """Check the file, if one is named."""
        ends_in(*endings)(ctx, param, value)
        if value is None:
            return value
        package = "plotly" if value.lower().endswith(PAGE) else "matplotlib"
        required(package, "plot", "this")
        return value

    return check


figure_file = figure_in(*FORMATS)
chart_file = figure_in(*FORMATS, PAGE)


def plot_option(what: str, *, page: bool = False) -> click.Option:
    """Return the option `--plot`: the file of a figure, or None.

    Args:
        what: The content of the figure, for the help.
        page: Whether the figure can also be a page (.html).
    """
    endings = ".png, .svg, .pdf or .html" if page else ".png, .svg or .pdf"
    callback = chart_file if page else figure_file
    return click.Option(["--plot"], metavar="FILE", callback=callback, help=f"Draw {what}: {endings}.")


def title_of(robot: HybridRobot, source: str) -> str:
    """Return the title of a figure of a robot and a table or a scene."""
    return f"{robot.name}, {os.path.basename(source)}"


def save(drawn: PanelFigure | Figure, target: str) -> None:
    """Write a chart or a figure in the format of its file's ending; the file appears when it is complete."""
    from ...figures.as_matplotlib import figure_of_chart
    from ...figures.as_page import page_of_chart
    from ...figures.panels import PanelFigure

    if isinstance(drawn, PanelFigure) and target.lower().endswith(PAGE):
        write_text(target, page_of_chart(drawn))
        return
    figure = figure_of_chart(drawn) if isinstance(drawn, PanelFigure) else drawn
    import matplotlib

    # Text stays text in SVG: it can be searched, and the file is small.
    with appearing(target) as partial, matplotlib.rc_context({"svg.fonttype": "none"}):
        figure.savefig(partial, dpi=DPI, format=target.rpartition(".")[2].lower())
