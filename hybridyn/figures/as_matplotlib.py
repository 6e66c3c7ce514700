"""Draw a chart as a matplotlib figure, without pyplot: no window opens and no figure stays in memory."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import required
from .panels import Panel, PanelFigure

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTHS, HEIGHT = {1: 10.0, 2: 14.0, 3: 18.0}, 2.3  # of figures by columns, of panels [inch]
#: Largest number of names in one column of a legend.
MOST_NAMES = 12
#: Letters of a legend that fit into an inch, and how many its signs take.
LETTERS_PER_INCH, LETTERS_OF_KEY = 14, 6
#: Number of names below bars, and the angle at which they are written where there are more.
LEVEL, SLOPE = 4, 30
#: How marks are drawn.
STYLES: dict[str, dict[str, Any]] = {
    "solid": {"linewidth": 1.3},
    "dashed": {"linewidth": 1.0, "linestyle": "--"},
    "dots": {"linestyle": "none", "marker": ".", "markersize": 2.5, "alpha": 0.6},
    "dot": {"linestyle": "none", "marker": "o", "markersize": 3.5},
    "ring": {"linestyle": "none", "marker": "o", "markersize": 9, "markerfacecolor": "none", "zorder": 4},
    "pale": {"linestyle": "none", "marker": ".", "markersize": 5, "alpha": 0.16, "markeredgewidth": 0},
    "front": {"linewidth": 1.4, "marker": "o", "markersize": 4.2},
    "open": {"linewidth": 1.4, "marker": "o", "markersize": 4.2, "markerfacecolor": "white"},
}


def empty_figure(width: float, height: float) -> Figure:
    """Return an empty figure.

    Args:
        width: Its width [inch].
        height: Its height [inch].

    Raises:
        HybridynError: matplotlib is missing.
    """
    matplotlib = required("matplotlib.figure", "plot", "a figure")
    figure: Figure = matplotlib.Figure(figsize=(width, height), layout="constrained")
    return figure


def figure_of_chart(chart: PanelFigure) -> Figure:
    """Draw a chart as a matplotlib figure.

    Raises:
        HybridynError: matplotlib is missing.
    """
    columns, rows, shared = chart.columns, chart.rows, bool(chart.x_label)
    width, height = (WIDTHS[columns], HEIGHT) if shared else (chart.size[0] * columns + 0.6, chart.size[1])
    figure = empty_figure(max(width, 5.0), height * rows + 0.5)
    figure.suptitle(chart.title, fontsize="medium")
    axes = figure.subplots(rows, columns, sharex=shared, squeeze=False).ravel()
    named: dict[str, Artist] = {}
    for ax, panel in itertools.zip_longest(axes, chart.panels):
        if panel is None:
            ax.set_axis_off()
            continue
        own = _draw(ax, panel)
        named |= own
        if shared and own:
            across = 1 + (len(own) - 1) // MOST_NAMES
            place = {"loc": "center left", "bbox_to_anchor": (1.0, 0.5), "ncols": across}
            ax.legend([*own.values()], [*own], fontsize="x-small", **place)
    for ax in axes[max(len(chart.panels) - columns, 0) : len(chart.panels)] if shared else ():
        ax.set_xlabel(chart.x_label)
        ax.tick_params(labelbottom=True)
    if named and not shared:
        letters = max(map(len, named)) + LETTERS_OF_KEY
        across = max(1, min(len(named), int(figure.get_figwidth() * LETTERS_PER_INCH / letters)))
        figure.legend([*named.values()], [*named], loc="outside lower center", ncols=across, fontsize="small")
    return figure


def _draw(ax: Axes, panel: Panel) -> dict[str, Artist]:
    """Draw a panel, and return what its legend names."""
    named: dict[str, Artist] = {}
    bars = [mark for mark in panel.marks if mark.style == "bar"]
    for number, mark in enumerate(panel.marks):
        artist: Artist
        if mark.style == "bar":
            width = 0.8 / len(bars)
            places = np.arange(len(mark.x)) + (number - (len(bars) - 1) / 2) * width
            artist = ax.bar(places, mark.y, width, color=mark.colour).patches[0]
            ax.set_xticks(range(len(mark.x)), mark.x, rotation=SLOPE * (len(mark.x) > LEVEL))
        else:
            (artist,) = ax.plot(mark.x, mark.y, color=mark.colour, **STYLES[mark.style])
        if mark.name:
            named[mark.name] = artist
    for axis in panel.logarithmic:
        ax.set(**{f"{axis}scale": "log"})
    ax.set_title(panel.title, loc="left", fontsize="small", color=panel.colour, weight="bold")
    ax.set_xlabel(panel.x_label, fontsize="small")
    ax.set_ylabel(panel.label, fontsize="small")
    ax.tick_params(labelsize="small")
    ax.grid(visible=True, alpha=0.3)
    return named
