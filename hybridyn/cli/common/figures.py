"""Options that name files of figures, and writing figures to them."""

from __future__ import annotations

import importlib.util
from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

from ...errors import install_advice
from .files import ends_in

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ...figures.panels import Chart
    from ...streams.blocks import Done
    from ...structure.robot import HybridRobot

FORMATS = (".png", ".svg", ".pdf")
PAGE = ".html"
GRAPH = ".dot"
DPI = 120


def figure_file(ctx: click.Context, param: click.Parameter, value: str | None) -> str | None:
    """Check the ending and the folder of a figure's file, before any work is done."""
    return None if value is None else check_figure(ctx, param, value, FORMATS)


def chart_file(ctx: click.Context, param: click.Parameter, value: str | None) -> str | None:
    """Check the ending and the folder of a chart's file, a figure or a page, before any work is done."""
    return None if value is None else check_figure(ctx, param, value, (*FORMATS, PAGE))


def drawing_file(ctx: click.Context, param: click.Parameter, value: str | None) -> str | None:
    """Check the ending and the folder of a drawing's file, before any work is done."""
    return None if value is None else check_figure(ctx, param, value, (*FORMATS, GRAPH))


def check_figure(ctx: click.Context, param: click.Parameter, value: str, endings: tuple[str, ...]) -> str:
    """Check a figure's ending and folder, and that the package for this kind of file is installed.

    Raises:
        click.BadParameter: One of these is wrong.
    """
    ends_in(*endings)(ctx, param, value)
    package = "plotly" if value.lower().endswith(PAGE) else "matplotlib"
    if value.lower().endswith(GRAPH):
        return value
    if importlib.util.find_spec(package) is None:
        message = f"this needs {package}: {install_advice('plot')}"
        raise click.BadParameter(message, ctx, param)
    return value


def plot_option(what: str, *, page: bool = False) -> click.Option:
    """Return the option `--plot`: the file of a figure, or None.

    Args:
        what: The content of the figure, for the help.
        page: Whether the figure can also be a page (.html).
    """
    endings = ".png, .svg, .pdf or .html" if page else ".png, .svg or .pdf"
    callback = chart_file if page else figure_file
    return click.Option(["--plot"], metavar="FILE", callback=callback, help=f"Draw {what}: {endings}.")


def save(figure: Figure, target: str) -> None:
    """Write a figure; its file appears when it is complete."""
    import matplotlib

    from ...description.writing import appearing

    # Text stays text in SVG: it can be searched, and the file is small.
    with appearing(target) as partial, matplotlib.rc_context({"svg.fonttype": "none"}):
        figure.savefig(partial, dpi=DPI)


def save_chart(chart: Chart, target: str) -> None:
    """Write a chart in the format of its file's ending; the file appears when it is complete."""
    if target.lower().endswith(PAGE):
        from ...description.writing import write_text
        from ...figures.as_page import page_of_chart

        write_text(target, page_of_chart(chart))
        return
    from ...figures.as_matplotlib import figure_of_chart

    save(figure_of_chart(chart), target)


def save_structure(robot: HybridRobot, target: str) -> None:
    """Draw the tree of modules in the format of its file's ending."""
    from ...description.writing import write_text
    from ...figures.structure_cards import cards, dot_of_cards

    if not target.lower().endswith(GRAPH):
        from ...figures.structure import figure_of_cards

        save(figure_of_cards(cards(robot)), target)
        return
    write_text(target, dot_of_cards(cards(robot)))


class Drawing:
    """A chart to which the rows of a result are added block by block."""

    def __init__(self, target: str) -> None:
        from ...figures.envelope import Envelope

        self.target, self.rows, self.timed = target, Envelope(), True

    def add(self, done: Done) -> None:
        """Add a block."""
        import numpy as np

        self.timed = done.time is not None
        numbers = np.arange(done.first_row, done.first_row + len(done.rows), dtype=float)
        self.rows.add(numbers if done.time is None else done.time, done.rows)

    def save(self, robot: HybridRobot, columns: Sequence[str], title: str) -> None:
        """Write the chart."""
        from ...figures.motion import chart_of_rows

        x, rows = self.rows.lines()
        save_chart(chart_of_rows(robot, columns, x, rows, timed=self.timed, title=title), self.target)
