"""Panels of log-log curves with their names written beside them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.labels import CROWDED, Box, around, beside, spread

if TYPE_CHECKING:
    from matplotlib.axes import Axes

INK, GRID, PALE = "#222222", "#e4e4e4", 0.16
#: Width and height of the axes [inch].
PANEL = (3.3, 2.75)
#: Left of them and below.
MARGIN = (0.75, 0.6)
#: With the names and the title.
CELL = (MARGIN[0] + PANEL[0] + 2.25, MARGIN[1] + PANEL[1] + 0.45)
#: Above the panels.
HEAD = 0.55
#: Least range of an axis.
DECADES = 2.2
DOTS = 100
#: Half the room that a point takes [points].
MARKER = 3.0
#: Of the names inside an SVG, so that equal figures are equal files.
SEED = "hybridyn"


@dataclass(frozen=True)
class Curve:
    """A curve with its name.

    Attributes:
        label: Its name.
        colour: Its colour.
        x, y: Its points.
        all_x, all_y: Points of a sweep behind it.
        filled: False for open markers.
        first_open: True where the first marker is open.
    """

    label: str
    colour: str
    x: Sequence[float]
    y: Sequence[float]
    all_x: Sequence[float] = ()
    all_y: Sequence[float] = ()
    filled: bool = True
    first_open: bool = False


@dataclass(frozen=True)
class Panel:
    """Curves over common axes.

    Attributes:
        title: Over the axes.
        x, y: Names of the axes.
        curves: The curves.
        reverse: True where x falls to the right.
        inside: True to name curves beside their ends where there is room.
        counts: True where x counts something: every number that occurs is written.
    """

    title: str
    x: str
    y: str
    curves: list[Curve] = field(default_factory=list)
    reverse: bool = False
    inside: bool = False
    counts: bool = False


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
        if curve.first_open:
            ax.plot(curve.x[:1], curve.y[:1], "o", color=curve.colour, mfc="white", markersize=4.2, zorder=4)
    if panel.reverse:
        ax.invert_xaxis()
    ax.set_title(panel.title, loc="left", color=INK)
    ax.set_xlabel(panel.x, color=INK)
    ax.set_ylabel(panel.y, color=INK)
    ax.grid(True, which="major", color=GRID, lw=0.7, zorder=0)
    if panel.counts:
        counted = sorted({int(x) for curve in panel.curves for x in curve.x})
        ax.set_xticks(counted, [str(x) for x in counted])
    ax.minorticks_off()
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)
    ax.margins(0.06)
    ax.autoscale_view()  # limits are otherwise found when the figure is drawn
    for limits, widen in ((ax.get_xlim(), ax.set_xlim), (ax.get_ylim(), ax.set_ylim)):
        widen(*widened(*limits))


def _names(ax: Axes, panel: Panel) -> None:
    """Write the curves' names: beside lone points, or right of the panel with thin lines to the curves."""
    scale = 72.0 / ax.get_figure(root=True).dpi  # type: ignore[union-attr]
    edge = ax.get_window_extent()
    box = Box(scale * edge.x0, scale * edge.y0, scale * edge.x1, scale * edge.y1)

    def at(x: Sequence[float], y: Sequence[float]) -> list[tuple[float, float]]:
        points = ax.transData.transform(np.column_stack([x, y])) * scale if len(x) else []
        return [(float(a), float(b)) for a, b in points]

    taken = [around(*p, MARKER) for c in panel.curves for p in at(c.all_x, c.all_y) + at(c.x, c.y)]
    for c in panel.curves:  # lines, as squares along them
        for (x0, y0), (x1, y1) in pairwise(at(c.x, c.y)):
            steps = np.linspace(0.0, 1.0, int(np.hypot(x1 - x0, y1 - y0) // MARKER) + 2)
            taken += [around(x0 + t * (x1 - x0), y0 + t * (y1 - y0), MARKER / 2) for t in steps]
    far = []
    for curve in panel.curves:
        (point,) = at(*([v] for v in _end(curve, panel.reverse)))
        (other,) = at(curve.x[:1], curve.y[:1])
        places = (beside(end, curve.label, taken, box) for end in (point, other) if panel.inside)
        place = next((found for found in places if found is not None), None)
        if place is None:
            far.append((curve, point))
            continue
        taken.append(place)
        middle = (place.low + place.high) / 2
        _write(ax, curve, point, (place.left, middle), None)
    heights = spread([y for _, (_, y) in far], CROWDED, box.low, box.high)
    for (curve, point), height in zip(far, heights, strict=True):
        line = {"arrowstyle": "-", "color": curve.colour, "lw": 0.5, "alpha": 0.55, "shrinkB": 3}
        _write(ax, curve, point, (box.right + 14.0, float(height)), line | {"relpos": (0, 0.5)})


def _write(
    ax: Axes, curve: Curve, point: tuple[float, float], at: tuple[float, float], line: dict[str, Any] | None
) -> None:
    """Write a curve's name at a place [points of the figure], with a line to a point or without."""
    ax.annotate(
        curve.label,
        xy=point,
        xycoords="figure points",
        xytext=at,
        textcoords="figure points",
        color=curve.colour,
        fontsize=8,
        va="center",
        annotation_clip=False,
        arrowprops=line,
    )


def widened(low: float, high: float) -> tuple[float, float]:
    """Return limits at least some powers of ten apart, so that axes show more than one of them."""
    missing = (DECADES - abs(math.log10(high / low))) / 2
    factor = 10.0 ** max(missing, 0.0)
    return (low / factor, high * factor) if low < high else (low * factor, high / factor)


def _end(curve: Curve, reverse: bool) -> tuple[float, float]:
    """Return the point that a curve's name belongs to, the rightmost."""
    at = int(np.argmin(curve.x) if reverse else np.argmax(curve.x))
    return float(curve.x[at]), float(curve.y[at])
