"""Panels of log-log curves with their names written beside them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes

INK, GRID, PALE = "#222222", "#e4e4e4", 0.16
PANEL = (3.3, 2.75)  # width and height of the axes [inch]
MARGIN = (0.75, 0.6)  # left of them and below
CELL = (MARGIN[0] + PANEL[0] + 2.25, MARGIN[1] + PANEL[1] + 0.45)  # with the names and the title
HEAD = 0.55  # above the panels
DECADES = 2.2  # least range of an axis
DOTS = 100
CROWDED = 12.0  # least vertical distance of two labels [points]
SEED = "hybridyn"  # of the names inside an SVG, so that equal figures are equal files


@dataclass(frozen=True)
class Curve:
    """A curve with its name.

    Attributes:
        label: Its name.
        colour: Its colour.
        x, y: Its points.
        all_x, all_y: Points of a sweep behind it.
        filled: False for open markers.
    """

    label: str
    colour: str
    x: Sequence[float]
    y: Sequence[float]
    all_x: Sequence[float] = ()
    all_y: Sequence[float] = ()
    filled: bool = True


@dataclass(frozen=True)
class Panel:
    """Curves over common axes.

    Attributes:
        title: Over the axes.
        x, y: Names of the axes.
        curves: The curves.
        reverse: True where x falls to the right.
    """

    title: str
    x: str
    y: str
    curves: list[Curve] = field(default_factory=list)
    reverse: bool = False


def draw(title: str, remark: str, rows: Sequence[Sequence[Panel]], path: Path) -> None:
    """Draw rows of panels into a file, by its suffix."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    width, height = CELL[0] * max(len(row) for row in rows), CELL[1] * len(rows) + HEAD
    with mpl.rc_context({"svg.hashsalt": SEED, "font.size": 9, "axes.titlesize": 10}):
        figure = Figure(figsize=(width, height), facecolor="white")
        figure.text(0.15 / width, 1 - 0.28 / height, title, fontsize=13, color=INK, weight="bold")
        figure.text(0.15 / width, 1 - 0.48 / height, remark, fontsize=9, color="#666666")
        for i, row in enumerate(rows):
            for j, panel in enumerate(row):
                left, low = CELL[0] * j + MARGIN[0], CELL[1] * (len(rows) - 1 - i) + MARGIN[1]
                place = (left / width, low / height, PANEL[0] / width, PANEL[1] / height)
                ax = figure.add_axes(place)
                _panel(ax, panel)
                _names(ax, panel)
        figure.savefig(path, metadata={"Date": None} if path.suffix == ".svg" else None, dpi=DOTS)


def _panel(ax: Axes, panel: Panel) -> None:
    """Draw the curves of a panel."""
    ax.set_xscale("log")
    ax.set_yscale("log")
    for curve in panel.curves:
        ax.plot(curve.all_x, curve.all_y, ".", color=curve.colour, alpha=PALE, markersize=5, mew=0, zorder=2)
        face = curve.colour if curve.filled else "white"
        ax.plot(
            curve.x, curve.y, "-o", color=curve.colour, markerfacecolor=face, markersize=4.2, lw=1.4, zorder=3
        )
    if panel.reverse:
        ax.invert_xaxis()
    ax.set_title(panel.title, loc="left", color=INK)
    ax.set_xlabel(panel.x, color=INK)
    ax.set_ylabel(panel.y, color=INK)
    ax.grid(True, which="major", color=GRID, lw=0.7, zorder=0)
    ax.minorticks_off()
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)
    ax.margins(0.06)
    ax.autoscale_view()  # limits are otherwise found when the figure is drawn
    for limits, widen in ((ax.get_xlim(), ax.set_xlim), (ax.get_ylim(), ax.set_ylim)):
        widen(*widened(*limits))


def _names(ax: Axes, panel: Panel) -> None:
    """Write the curves' names right of the panel, near the heights of their ends, with thin lines to them."""
    if not panel.curves:
        return
    box = ax.get_window_extent()
    to_points = 72.0 / ax.get_figure(root=True).dpi  # type: ignore[union-attr]
    ends = [ax.transData.transform(_end(curve, panel.reverse)) for curve in panel.curves]
    wanted = np.array([end[1] for end in ends]) * to_points
    heights = spread(wanted, CROWDED, box.y0 * to_points, box.y1 * to_points)
    for curve, end, height in zip(panel.curves, ends, heights, strict=True):
        ax.annotate(
            curve.label,
            xy=tuple(ax.transData.inverted().transform(end)),
            xycoords="data",
            xytext=(box.x1 * to_points + 14.0, float(height)),
            textcoords="figure points",
            color=curve.colour,
            fontsize=8,
            va="center",
            annotation_clip=False,
            arrowprops={
                "arrowstyle": "-",
                "color": curve.colour,
                "lw": 0.5,
                "alpha": 0.55,
                "shrinkB": 3,
                "relpos": (0, 0.5),
            },
        )


def widened(low: float, high: float) -> tuple[float, float]:
    """Give limits at least some powers of ten apart, so that axes show more than one of them."""
    missing = (DECADES - abs(math.log10(high / low))) / 2
    factor = 10.0 ** max(missing, 0.0)
    return (low / factor, high * factor) if low < high else (low * factor, high / factor)


def _end(curve: Curve, reverse: bool) -> tuple[float, float]:
    """Give the point that a curve's name belongs to, the rightmost."""
    at = int(np.argmin(curve.x) if reverse else np.argmax(curve.x))
    return float(curve.x[at]), float(curve.y[at])


def spread(wanted: Any, apart: float, low: float, high: float) -> Any:
    """Move heights as little as it takes to keep them apart, within a range where they fit."""
    order = np.argsort(wanted)
    out = np.array(wanted, dtype=float)
    for before, at in pairwise(order):
        out[at] = max(out[at], out[before] + apart)
    excess = out[order[-1]] - max(high, low + apart * (len(out) - 1)) if len(out) else 0.0
    if excess > 0:
        out[order[-1]] -= excess
        for after, at in pairwise(order[::-1]):
            out[at] = min(out[at], out[after] - apart)
    return out
