"""Speed-effort cloud of every motor with its limits; a motor's characteristic must enclose it.

`clouds` holds what is drawn as plain data. It becomes a matplotlib figure here, and a page in `sizing_page`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..spatial import Array
from ..studies.sizing import Sizing
from .blank import empty_figure

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Columns of panels: a module of six motors fills a row.
COLUMNS = 6
#: A limit is drawn if it is at most this multiple of the peak. A higher one would shrink the cloud to a dot.
CLOUD_LIMIT_FACTOR = 3.0


@dataclass(frozen=True, eq=False)
class Cloud:
    """What is drawn of one motor.

    Attributes:
        units: Units of speed and effort.
        points: Speed and effort of the samples, shape (T, 2).
        peak: Speed and effort where the effort is largest, or None without samples.
        rms: RMS effort.
        effort_limit: Limit of the effort, inf where it is not drawn.
        speed_limit: Limit of the speed, inf where it is not drawn.
    """

    motor: str
    units: tuple[str, str]
    points: Array
    peak: tuple[float, float] | None
    rms: float
    effort_limit: float
    speed_limit: float


def clouds(sizing: Sizing) -> list[Cloud]:
    """Return what is drawn of each motor."""
    out = []
    for i, load in enumerate(sizing.loads()):
        points = sizing.cloud.points[:, i]
        at = int(np.argmax(np.abs(points[:, 1]))) if len(points) else 0
        limits = (load.effort_limit, load.effort.value), (load.speed_limit, load.speed.value)
        effort_limit, speed_limit = (
            limit if limit <= CLOUD_LIMIT_FACTOR * abs(peak) else math.inf for limit, peak in limits
        )
        out.append(
            Cloud(
                load.motor,
                ("m/s", "N") if load.linear else ("rad/s", "N m"),
                points,
                (float(points[at, 0]), load.effort.value) if len(points) else None,
                load.rms_effort,
                effort_limit,
                speed_limit,
            )
        )
    return out


def figure_of_sizing(sizing: Sizing, *, title: str = "") -> Figure:
    """Draw one panel per motor: effort over speed at every sample, RMS effort, peaks, and the limits.

    Raises:
        HybridynError: matplotlib is missing.
    """
    shown = clouds(sizing)
    columns = min(COLUMNS, max(len(shown), 1))
    rows = max(math.ceil(len(shown) / columns), 1)
    figure = empty_figure(2.6 * columns + 0.6, 2.5 * rows + 0.4)
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for ax, cloud in zip(panels, shown, strict=False):
        _draw(ax, cloud)
    for ax in panels[len(shown) :]:
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


def _draw(ax: Axes, cloud: Cloud) -> None:
    ax.plot(cloud.points[:, 0], cloud.points[:, 1], ".", markersize=2.5, alpha=0.6, label="samples")
    if cloud.peak:
        ax.plot(*cloud.peak, "k^", markersize=5, label="peak effort")
    for sign in (-1.0, 1.0):
        ax.axhline(sign * cloud.rms, color="tab:green", linewidth=0.9, linestyle="--", label="RMS effort")
        if cloud.effort_limit < math.inf:
            ax.axhline(sign * cloud.effort_limit, color="tab:red", linewidth=1.0, label="limit")
        if cloud.speed_limit < math.inf:
            ax.axvline(sign * cloud.speed_limit, color="tab:red", linewidth=1.0, label="limit")
    speed_unit, effort_unit = cloud.units
    ax.set_title(cloud.motor, fontsize="small")
    ax.set_xlabel(f"speed [{speed_unit}]", fontsize="x-small")
    ax.set_ylabel(f"effort [{effort_unit}]", fontsize="x-small")
    ax.tick_params(labelsize="x-small")
    ax.grid(visible=True, alpha=0.3)
