"""Panels of curves with one legend, log-log for the most part: the figures of the report."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from hybridyn.figures.as_matplotlib import empty_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

INK, GRID, PALE = "#222222", "#e4e4e4", 0.16
#: Width and height of a panel, width of the legend [inch].
PANEL, LEGEND = (3.6, 2.9), 3.2
#: Sizes of text.
LOOK: Any = {"font.size": 9, "axes.titlesize": 10, "legend.fontsize": 8}
#: Least range of an axis.
DECADES = 2.2
#: Of what other panels show of the same quantity: below, a panel would show rounding alone.
ZERO_PANEL = 1e-12
#: What nothing is drawn at.
LEAST = 1e-17


@dataclass(frozen=True)
class Curve:
    """A curve with its name.

    Attributes:
        label: Its name.
        colour: Its colour.
        x, y: Its points.
        hollow: Which of them are drawn open.
        joined: Whether a line joins them.
        all_x, all_y: Points of a sweep behind it.
    """

    label: str
    colour: str
    x: Sequence[float]
    y: Sequence[float]
    hollow: Sequence[bool] = ()
    joined: bool = True
    all_x: Sequence[float] = ()
    all_y: Sequence[float] = ()


@dataclass(frozen=True)
class Panel:
    """Curves over common axes.

    Attributes:
        title: Over the axes.
        x, y: Names of the axes.
        curves: The curves.
        counted: Whether the horizontal axis counts, and is not logarithmic.
    """

    title: str
    x: str
    y: str
    curves: list[Curve] = field(default_factory=list)
    counted: bool = False

    @property
    def top(self) -> float:
        """The largest number that it shows."""
        return max((y for curve in self.curves for y in curve.y), default=0.0)


def draw(title: str, remark: str, rows: Sequence[Sequence[Panel]]) -> Figure:
    """Draw rows of panels.

    Raises:
        HybridynError: matplotlib is missing.
    """
    columns = max(len(row) for row in rows)
    figure = empty_figure(PANEL[0] * columns + LEGEND, PANEL[1] * len(rows) + 0.6)
    import matplotlib as mpl

    with mpl.rc_context(LOOK):
        figure.suptitle(f"{title}\n{remark}", fontsize=11, color=INK, x=0.01, ha="left")
        axes = figure.subplots(len(rows), columns, squeeze=False)
        every = [panel for row in rows for panel in row]
        for ax in axes.flat:
            ax.set_axis_off()
        for own, row in zip(axes, rows, strict=True):
            for ax, panel in zip(own, row, strict=False):
                ax.set_axis_on()
                ax.set_title(panel.title, loc="left", color=INK)
                ax.spines[["top", "right"]].set_visible(False)
                _panel(ax, panel, max(other.top for other in every if other.y == panel.y))
        keys = [ax.get_legend_handles_labels() for ax in axes.flat]
        named = {name: key for one in keys for key, name in zip(*one, strict=True)}
        figure.legend([*named.values()], [*named], loc="outside right upper", frameon=False)
        return figure


def _panel(ax: Axes, panel: Panel, most: float) -> None:
    """Draw the curves of a panel, beside panels that show so much of the same quantity."""
    from matplotlib.ticker import MaxNLocator

    if panel.top < ZERO_PANEL * most:
        ax.text(0.5, 0.5, "zero", ha="center", transform=ax.transAxes)
        ax.set(xticks=[], yticks=[])
        return
    ax.set(xscale="linear" if panel.counted else "log", yscale="log", xlabel=panel.x, ylabel=panel.y)
    for curve in panel.curves:
        _curve(ax, curve)
    ax.grid(True, which="major", color=GRID, lw=0.7, zorder=0)
    ax.minorticks_off()
    ax.autoscale_view()  # limits are otherwise found when the figure is drawn
    if panel.counted:
        ax.xaxis.set_major_locator(MaxNLocator("auto", integer=True))
    ax.set(xlim=ax.get_xlim() if panel.counted else widened(*ax.get_xlim()), ylim=widened(*ax.get_ylim()))


def _curve(ax: Axes, curve: Curve) -> None:
    """Draw a curve, what it was chosen from, and its open points."""
    y, all_y = ([max(value, LEAST) for value in values] for values in (curve.y, curve.all_y))
    ax.plot(curve.all_x, all_y, ".", color=curve.colour, alpha=PALE, markersize=5, mew=0, zorder=2)
    style = "-o" if curve.joined else "o"
    ax.plot(curve.x, y, style, color=curve.colour, label=curve.label, lw=1.4, markersize=4.2, zorder=3)
    for x, height, is_open in zip(curve.x, y, curve.hollow, strict=False):
        if is_open:
            ax.plot(x, height, "o", color=curve.colour, mfc="white", markersize=4.2, zorder=4)


def widened(low: float, high: float) -> tuple[float, float]:
    """Return limits at least some powers of ten apart, so that axes show more than one of them."""
    factor = 10.0 ** max((DECADES - math.log10(high / low)) / 2, 0.0)
    return low / factor, high * factor
