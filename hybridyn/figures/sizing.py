"""Speed-effort cloud of every motor with its limits; a motor's characteristic must enclose it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ..studies.sizing import MotorLoad, Sizing
from .blank import empty_figure

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ..spatial import Array

#: Columns of panels: a module of six motors fills a row.
COLUMNS = 6
#: A limit is drawn if it is at most this multiple of the peak. A higher one would shrink the cloud to a dot.
CLOUD_LIMIT_FACTOR = 3.0


def figure_of_sizing(sizing: Sizing, *, title: str = "") -> Figure:
    """Draw one panel per motor: effort over speed at every sample, RMS effort, peaks, and the limits.

    Args:
        sizing: The accumulated loads.
        title: Title of the figure.

    Raises:
        HybridynError: matplotlib is missing.
    """
    loads = sizing.loads()
    columns = min(COLUMNS, max(len(loads), 1))
    rows = max(math.ceil(len(loads) / columns), 1)
    figure = empty_figure(2.6 * columns + 0.6, 2.5 * rows + 0.4)
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for i, (ax, load) in enumerate(zip(panels, loads, strict=False)):
        _draw(ax, load, sizing.cloud.points[:, i])
    for ax in panels[len(loads) :]:
        ax.set_axis_off()
    figure.suptitle(title)
    _legend(figure)
    return figure


def _legend(figure: Figure) -> None:
    """Draw one legend for all panels; each entry copies the style of the first panel that contains it."""
    drawn: dict[str, Artist] = {}
    for ax in figure.axes:
        for artist, name in zip(*ax.get_legend_handles_labels(), strict=True):
            drawn.setdefault(name, artist)
    if drawn:
        names, artists = [*drawn], [*drawn.values()]
        figure.legend(artists, names, loc="outside lower center", ncols=len(names), fontsize="small")


def _draw(ax: Axes, load: MotorLoad, cloud: Array) -> None:
    speed_unit, effort_unit = ("m/s", "N") if load.linear else ("rad/s", "N m")
    ax.plot(cloud[:, 0], cloud[:, 1], ".", markersize=2.5, alpha=0.6, label="samples")
    peak = np.argmax(np.abs(cloud[:, 1])) if len(cloud) else 0
    if len(cloud):
        ax.plot(cloud[peak, 0], load.effort.value, "k^", markersize=5, label="peak effort")
    for sign in (-1.0, 1.0):
        ax.axhline(
            sign * load.rms_effort, color="tab:green", linewidth=0.9, linestyle="--", label="RMS effort"
        )
        if load.effort_limit <= CLOUD_LIMIT_FACTOR * abs(load.effort.value):
            ax.axhline(sign * load.effort_limit, color="tab:red", linewidth=1.0, label="limit")
        if load.speed_limit <= CLOUD_LIMIT_FACTOR * abs(load.speed.value):
            ax.axvline(sign * load.speed_limit, color="tab:red", linewidth=1.0, label="limit")
    ax.set_title(load.motor, fontsize="small")
    ax.set_xlabel(f"speed [{speed_unit}]", fontsize="x-small")
    ax.set_ylabel(f"effort [{effort_unit}]", fontsize="x-small")
    ax.tick_params(labelsize="x-small")
    ax.grid(visible=True, alpha=0.3)
