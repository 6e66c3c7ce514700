"""Figures of a sweep: every measure over every parameter, parallel coordinates, sensitivity indices."""

from __future__ import annotations

from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np

from ..spatial import Array, Mask
from ..studies.sweep.best import rows_of
from ..studies.sweep.sensitivity import KINDS, sensitivity
from ..studies.sweep.shards import About, about_of
from .blank import empty_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Largest number of points per panel; of more designs, evenly spaced ones are drawn.
MOST_POINTS = 20_000
#: Largest number of lines in parallel coordinates; more hide each other.
MOST_LINES = 1_000
#: Largest number of rows, and of columns, of panels.
MOST_PANELS = 8


def figure_of_sweep(folder: str | PathLike[str], where: str | None = None) -> Figure:
    """Draw a sweep: a row of panels per measure, a column per parameter.

    Designs that could not be evaluated are red marks at the bottom; those that do not meet `where` are grey.

    Raises:
        HybridynError: matplotlib is missing, the folder has no results, or the condition is wrong.
    """
    about, columns, masks = _columns(folder, where, MOST_POINTS)
    parameters, measures = about.parameters[:MOST_PANELS], about.measures[:MOST_PANELS]
    figure = empty_figure(2.6 * len(parameters) + 0.8, 2.1 * len(measures) + 0.6)
    panels = figure.subplots(len(measures), len(parameters), squeeze=False, sharex="col", sharey="row")
    for row, measure in zip(panels, measures, strict=True):
        for ax, parameter in zip(row, parameters, strict=True):
            _scatter(ax, columns[parameter], columns[measure], *masks)
            ax.tick_params(labelsize="x-small")
        row[0].set_ylabel(measure, fontsize="small")
    for ax, parameter in zip(panels[-1], parameters, strict=True):
        ax.set_xlabel(parameter, fontsize="small")
    _title(figure, about, masks)
    return figure


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
    ax.set_xticks(range(len(names)), names, fontsize="small", rotation=20)
    ax.set_yticks([])
    ax.set_ylim(-0.08, 1.08)
    ax.tick_params(axis="x", length=0, pad=8)
    ax.set_frame_on(False)
    _title(figure, about, masks)
    return figure


def figure_of_indices(folder: str | PathLike[str]) -> Figure:
    """Draw the sensitivity indices: a panel per measure, bars per parameter with their 95 % intervals.

    Raises:
        HybridynError: matplotlib or SALib is missing, or the folder has too few results.
    """
    about = about_of(str(folder))
    found = sensitivity(folder)
    kinds = list(dict.fromkeys(one.kind for one in found))
    measures = about.measures[:MOST_PANELS]
    figure = empty_figure(5.0, 1.0 + (0.5 + 0.3 * len(about.parameters)) * len(measures))
    panels = figure.subplots(len(measures), 1, squeeze=False)[:, 0]
    places = np.arange(len(about.parameters))[::-1]
    for ax, measure in zip(panels, measures, strict=True):
        for i, kind in enumerate(kinds):
            ours = [one for one in found if (one.measure, one.kind) == (measure, kind)]
            at = places + 0.4 * ((len(kinds) - 1) / 2 - i)
            bounds = np.nan_to_num([one.bound for one in ours])
            ax.barh(at, [one.value for one in ours], 0.8 / len(kinds), xerr=bounds, label=KINDS[kind])
        ax.set_yticks(places, about.parameters, fontsize="small")
        ax.set_title(measure, fontsize="small", loc="left")
        ax.tick_params(labelsize="x-small")
    panels[0].legend(fontsize="x-small")
    return figure


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


def _title(figure: Figure, about: About, masks: Mask) -> None:
    """Write above a figure of what it is."""
    shown = masks.shape[1]
    figure.suptitle(f"{about.study}: {shown:,} of {about.designs:,} designs", fontsize="medium")


def _scatter(ax: Axes, x: Array, y: Array, good: Mask, met: Mask) -> None:
    style: dict[str, Any] = {"linestyle": "none", "marker": ".", "markersize": 3}
    ax.plot(x[good & ~met], y[good & ~met], color="0.75", **style)
    ax.plot(x[met], y[met], color="C0", **style)
    bad = x[~good]
    ax.plot(
        bad,
        np.full(len(bad), 0.02),
        color="C3",
        linestyle="none",
        marker="|",
        markersize=5,
        transform=ax.get_xaxis_transform(),
    )
