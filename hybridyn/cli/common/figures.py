"""Options that name files of figures, and writing figures to them."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import click

from ...errors import install_advice
from .files import ends_in

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ...description.records import Array
    from ...figures.panels import Chart
    from ...streams.one_pass import Rows
    from ...structure.robot import HybridRobot
    from ...tables.columns import Layout

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
        if importlib.util.find_spec(package) is None:
            raise click.BadParameter(f"this needs {package}: {install_advice('plot')}", ctx, param)
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


class Drawing:
    """A chart of a result over time, which watches the blocks of a pass."""

    exceeded = ()

    def __init__(
        self, robot: HybridRobot, columns: Sequence[str], title: str, target: str, rows: int | None
    ) -> None:
        """Start without rows.

        Args:
            columns: Names of the columns of the rows.
            title: Title of the chart.
            target: The file, whose ending says its format.
            rows: Number of rows in all, roughly, or None if it is not known.
        """
        from ...figures.motion import MOST_SAMPLES

        self.robot, self.columns, self.title, self.target = robot, columns, title, target
        self.each, self.timed = max(1, (rows or 0) // MOST_SAMPLES), True
        self.parts: list[tuple[Array, Array]] = []

    def add(self, done: Rows) -> None:
        """Add a block."""
        import numpy as np

        from ...figures.motion import extremes

        self.timed = done.time is not None
        numbers = np.arange(done.first_row, done.first_row + len(done.rows), dtype=float)
        x = numbers if done.time is None else done.time
        self.parts.append(extremes(x, done.rows, self.each))

    def show(self, layout: Layout, quiet: bool) -> None:
        """Write the chart."""
        import numpy as np

        from ...figures.motion import chart_of_rows

        x, rows = map(np.concatenate, zip(*self.parts, strict=True))
        chart = chart_of_rows(self.columns, x, rows, robot=self.robot, timed=self.timed, title=self.title)
        save_chart(chart, self.target)
