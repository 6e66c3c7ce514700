"""Draw a chart as a matplotlib figure."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..colours import ALARM, MODULES
from .blank import empty_figure
from .panels import Chart, Panel

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTHS, HEIGHT = {1: 10.0, 2: 14.0, 3: 18.0}, 2.3  # of figures by columns, of panels [inch]
#: Largest number of names in one column of a legend.
MOST_NAMES = 12
#: Largest number of names below bars that are written almost level.
MOST_TICKS = 8
#: How marks are drawn.
STYLES: dict[str, dict[str, Any]] = {
    "dots": {"linestyle": "none", "marker": ".", "markersize": 2.5, "alpha": 0.6},
    "peak": {"linestyle": "none", "marker": "^", "markersize": 5},
    "solid": {"linewidth": 1.0},
    "dashed": {"linewidth": 0.9, "linestyle": "--"},
}


def figure_of_chart(chart: Chart) -> Figure:
    """Draw a chart as a matplotlib figure.

    Raises:
        HybridynError: matplotlib is missing.
    """
    columns = chart.columns
    rows = max(-(-len(chart.panels) // columns), 1)
    width, height = (2.6 * columns + 0.6, 2.5) if chart.across else (WIDTHS[columns], HEIGHT)
    figure = empty_figure(width, height * rows + 0.5)
    axes = figure.subplots(rows, columns, sharex=chart.over_time, squeeze=False)
    for ax, panel in zip(axes.ravel(), chart.panels, strict=False):
        if panel.marks:
            _marks(ax, panel)
        else:
            _bars(ax, panel) if panel.ticks else _lines(ax, chart, panel)
        _finish(ax, panel)
    for ax in axes.ravel()[len(chart.panels) :]:
        ax.set_axis_off()
    for number, ax in enumerate(axes.ravel()[: len(chart.panels)]):
        if number + columns >= len(chart.panels) and chart.over_time:
            ax.set_xlabel(chart.x_label)
            ax.tick_params(labelbottom=True)
    figure.suptitle(chart.title, fontsize="medium")
    _shared_legend(figure, chart)
    return figure


def _marks(ax: Axes, panel: Panel) -> None:
    """Draw points and lines with abscissas of their own."""
    for mark in panel.marks:
        ax.plot(mark.x, mark.y, color=mark.colour, label=mark.name, **STYLES[mark.style])
    ax.set_xlabel(panel.x_label, fontsize="small")


def _shared_legend(figure: Figure, chart: Chart) -> None:
    """Draw one legend for the marks of all panels."""
    drawn: dict[str, Artist] = {}
    for ax, panel in zip(figure.axes, chart.panels, strict=False):
        if panel.marks:
            artists, names = ax.get_legend_handles_labels()
            drawn = dict(zip(names, artists, strict=True)) | drawn
    if drawn:
        order = [mark.name for panel in chart.panels for mark in panel.marks]
        names = [*dict.fromkeys(order)]
        handles = [drawn[name] for name in names]
        figure.legend(handles, names, loc="outside lower center", ncols=len(names), fontsize="small")


def _lines(ax: Axes, chart: Chart, panel: Panel) -> None:
    """Draw lines, their peaks, and the limits close to them."""
    for number, line in enumerate(panel.lines):
        colour = MODULES[number % len(MODULES)]
        ax.plot(chart.x, line.y, color=colour, linewidth=1.3, label=line.name)
        if line.mark_peak and line.y.any():
            ax.plot(chart.x[line.peak], line.y[line.peak], "o", color=colour, markersize=3.5)
    if panel.logarithmic:
        ax.set_yscale("log")
    for limit, owner in panel.limits():
        colour = ALARM if owner is None else MODULES[owner % len(MODULES)]
        for sign in (-1.0, 1.0):
            ax.axhline(sign * limit, color=colour, linewidth=1.0, linestyle="--")
    marked = [line for line in panel.lines if line.mark_peak and line.y.any()]
    if marked:
        worst = max(marked, key=lambda line: abs(line.y[line.peak]))
        at, value = float(chart.x[worst.peak]), float(worst.y[worst.peak])
        right = at > (chart.x[0] + chart.x[-1]) / 2
        ax.annotate(
            f"{value:.4g} {panel.unit}",
            (at, value),
            xytext=(-6 if right else 6, 4 if value >= 0 else -4),
            textcoords="offset points",
            ha="right" if right else "left",
            va="bottom" if value >= 0 else "top",
            fontsize="x-small",
        )
        ax.margins(y=0.16)


def _bars(ax: Axes, panel: Panel) -> None:
    """Draw bars, one cluster per tick."""
    width = 0.8 / max(len(panel.lines), 1)
    places = np.arange(len(panel.ticks))
    for number, line in enumerate(panel.lines):
        shift = (number - (len(panel.lines) - 1) / 2) * width
        colour = MODULES[number % len(MODULES)]
        ax.bar(places + shift, line.y, width, yerr=line.bound, color=colour, label=line.name)
    many = len(panel.ticks) > MOST_TICKS
    rotation = 60 if many else 12 if len(panel.ticks) > 4 else 0
    align = "right" if many else "center"
    ax.set_xticks(
        places,
        panel.ticks,
        fontsize="x-small",
        rotation=rotation,
        ha=align,
        rotation_mode="anchor" if many else "default",
    )


def _finish(ax: Axes, panel: Panel) -> None:
    """Set title, label, grid and legend."""
    ax.set_title(panel.title, loc="left", fontsize="small", color=panel.colour or "black", weight="bold")
    if far := panel.far_limits():
        ax.set_title(far, loc="right", fontsize="x-small", color="#5b6068")
    ax.set_ylabel(panel.label, fontsize="small")
    ax.tick_params(labelsize="small")
    ax.grid(visible=True, alpha=0.3)
    if len(panel.lines) > 1 or (panel.lines and panel.unit):
        columns = 1 + (len(panel.lines) - 1) // MOST_NAMES
        ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize="x-small", ncols=columns)
