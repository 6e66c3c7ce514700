"""Scatter of a sweep: every measure over every parameter, one point per design."""

from __future__ import annotations

from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np

from ..spatial import Array, Mask
from ..studies.sweep.expressions import Expression
from ..studies.sweep.shards import about_of, read_shards
from .blank import empty_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Largest number of points per panel; of more designs, evenly spaced ones are drawn.
MOST_POINTS = 20_000
#: Largest number of rows, and of columns, of panels.
MOST_PANELS = 8


def figure_of_sweep(folder: str | PathLike[str], where: str | None = None) -> Figure:
    """Draw a sweep: a row of panels per measure, a column per parameter.

    Designs that could not be evaluated are red marks at the bottom; those that do not meet `where` are grey.

    Args:
        folder: Folder of the results.
        where: A condition on the columns.

    Raises:
        HybridynError: matplotlib is missing, the folder has no results, or the condition is wrong.
    """
    about = about_of(str(folder))
    parameters, measures = about.parameters[:MOST_PANELS], about.measures[:MOST_PANELS]
    numbers = ["design", *about.parameters, "unreachable", "singular", *about.measures]
    condition = None if where is None else Expression(where, numbers, "--where")
    stride = -(-about.designs // MOST_POINTS)
    kept: list[dict[str, Array]] = []
    masks: list[Mask] = []  # evaluated, and meeting the condition, shape (2, designs)
    for shard in read_shards(str(folder), [*numbers, "status"]):
        good: Mask = np.array(shard.pop("status")) == "ok"
        met = good if condition is None else good & np.broadcast_to(condition(shard), good.shape)
        rows = shard["design"] % stride == 0
        kept.append({name: values[rows] for name, values in shard.items()})
        masks.append(np.stack([good[rows], met[rows]]))
    columns = {name: np.concatenate([part[name] for part in kept]) for name in kept[0]} if kept else {}
    figure = empty_figure(2.6 * len(parameters) + 0.8, 2.1 * len(measures) + 0.6)
    panels = figure.subplots(len(measures), len(parameters), squeeze=False, sharex="col", sharey="row")
    for row, measure in zip(panels, measures, strict=True):
        for ax, parameter in zip(row, parameters, strict=True):
            if columns:
                _scatter(ax, columns[parameter], columns[measure], *np.concatenate(masks, axis=1))
            ax.tick_params(labelsize="x-small")
        row[0].set_ylabel(measure, fontsize="small")
    for ax, parameter in zip(panels[-1], parameters, strict=True):
        ax.set_xlabel(parameter, fontsize="small")
    shown = sum(len(part["design"]) for part in kept)
    figure.suptitle(f"{about.study}: {shown:,} of {about.designs:,} designs", fontsize="medium")
    return figure


def _scatter(ax: Axes, x: Array, y: Array, good: Mask, met: Mask) -> None:
    """Draw one panel."""
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
