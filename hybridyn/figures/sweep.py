"""Figures of a sweep: every measure over every parameter, parallel coordinates, sensitivity indices."""

from __future__ import annotations

from os import PathLike
from typing import TYPE_CHECKING

import numpy as np

from ..colours import ALARM, MODULES
from ..spatial import Array, Mask
from ..studies.sweep.best import rows_of
from ..studies.sweep.sensitivity import KINDS, sensitivity
from ..studies.sweep.shards import About, about_of
from .blank import empty_figure
from .panels import Chart, Line, Mark, Panel

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Colour of designs that do not meet a condition.
PALE = "#bfbfbf"
#: Largest number of points per panel; of more designs, evenly spaced ones are drawn.
MOST_POINTS = 20_000
#: Largest number of lines in parallel coordinates; more hide each other.
MOST_LINES = 1_000
#: Largest number of rows, and of columns, of panels.
MOST_PANELS = 8


def chart_of_sweep(folder: str | PathLike[str], where: str | None = None) -> Chart:
    """Build a chart of a sweep: a row of panels per measure, a column per parameter.

    Designs that could not be evaluated are red marks at the bottom; those that do not meet `where` are grey.

    Raises:
        HybridynError: The folder has no results, or the condition is wrong.
    """
    about, columns, (good, met) = _columns(folder, where, MOST_POINTS)
    parameters, measures = about.parameters[:MOST_PANELS], about.measures[:MOST_PANELS]
    panels = []
    for measure in measures:
        low = columns[measure][good].min() if good.any() else 0.0
        y = np.where(good, columns[measure], low)
        for name in parameters:
            marks = [
                Mark(what, columns[name][of], y[of], "dots", colour)
                for what, of, colour in (
                    ("does not meet the condition", good & ~met, PALE), ("designs", met, MODULES[0]),
                    ("not evaluated", ~good, ALARM),
                )
                if of.any()
            ]  # fmt: skip
            panels.append(Panel("", about.label(measure), (), marks=tuple(marks), x_label=name))
    return Chart(_title(about, len(good)), np.zeros(0), "", tuple(panels), across=len(parameters))


def figure_of_coordinates(folder: str | PathLike[str], where: str | None = None) -> Figure:
    """Draw a sweep in parallel coordinates: an axis per parameter and measure, a line per design.

    The colour is the first measure; designs that do not meet `where` are grey, and those that could not be
    evaluated are left out.

    Raises:
        HybridynError: matplotlib is missing, the folder has no results, or the condition is wrong.
    """
    about, columns, masks = _columns(folder, where, MOST_LINES)
    names = [*about.parameters, *about.measures]
    rows = np.column_stack([columns[name] for name in names])
    shown = np.isfinite(rows).all(axis=1) & masks[0]
    rows, met = rows[shown], masks[1][shown]
    figure = empty_figure(1.2 * len(names) + 1.0, 4.0)
    ax = figure.subplots()
    low, high = (rows.min(axis=0), rows.max(axis=0)) if len(rows) else np.zeros((2, len(names)))
    heights = (rows - low) / np.where(high > low, high - low, 1.0)
    colour = heights[:, len(about.parameters)]
    from matplotlib import colormaps

    palette = colormaps["viridis"]
    for i in np.argsort(met, kind="stable").tolist():  # grey lines first, below the others
        ax.plot(heights[i], color=palette(colour[i]) if met[i] else "0.85", linewidth=0.7, alpha=0.7)
    for at, (bottom, top) in enumerate(zip(low, high, strict=True)):
        ax.axvline(at, color="0.3", linewidth=0.8)
        for height, value, side in ((0.0, bottom, "top"), (1.0, top, "bottom")):
            ax.annotate(
                f"{value:.4g}", (at, height), (0, 2 if side == "bottom" else -2), textcoords="offset points",
                ha="center", va=side, fontsize="x-small",
            )  # fmt: skip
    ax.set_xticks(range(len(names)), [about.label(name) for name in names], fontsize="small", rotation=20)
    ax.set_yticks([])
    ax.set_ylim(-0.08, 1.08)
    ax.tick_params(axis="x", length=0, pad=8)
    ax.set_frame_on(False)
    figure.suptitle(_title(about, masks.shape[1]), fontsize="medium")
    return figure


def chart_of_indices(folder: str | PathLike[str]) -> Chart:
    """Build a chart of the sensitivity indices: a panel per measure, bars per parameter with 95 % intervals.

    Raises:
        HybridynError: SALib is missing, or the folder has too few results.
    """
    about, found = about_of(str(folder)), sensitivity(folder)
    panels = []
    for measure in about.measures[:MOST_PANELS]:
        ours = [one for one in found if one.measure == measure]
        lines = []
        for kind in dict.fromkeys(one.kind for one in ours):
            values, bounds = np.array([[one.value, one.bound] for one in ours if one.kind == kind]).T
            lines.append(Line(KINDS[kind], values, bound=np.nan_to_num(bounds)))
        panels.append(Panel(measure, "index", tuple(lines), ticks=tuple(about.parameters)))
    return Chart(about.study, np.zeros(0), "", tuple(panels), across=1)


def _columns(
    folder: str | PathLike[str], where: str | None, most: int
) -> tuple[About, dict[str, Array], Mask]:
    """Read evenly spaced designs: columns, shape (designs,), and masks, shape (2, designs).

    The masks say which designs were evaluated, and which of them meet the condition.
    """
    about, columns, status, met = rows_of(folder, where)
    some = columns["design"] % -(-about.designs // most) == 0
    masks = np.stack([status == "ok", met])
    return about, {name: values[some] for name, values in columns.items()}, masks[:, some]


def _title(about: About, shown: int) -> str:
    return f"{about.study}: {shown:,} of {about.designs:,} designs"
