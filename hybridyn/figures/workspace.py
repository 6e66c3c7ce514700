"""Maps of a workspace: conditioning and holding efforts over one, two or (as slices) three coordinates."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..linkage.targets import COORDINATES
from ..spatial import Array
from ..studies.workspace.workspace import Workspace
from .blank import empty_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Largest number of slices along the third coordinate.
SLICES = 5
LABELS = {
    "conditioning": "conditioning [-], 1 is isotropic",
    "effort_per_force": "largest effort per N of force",
    "effort_per_torque": "largest effort per N m of torque",
    "hold": "largest effort against gravity",
}
#: Unit in the denominator of a measure, below the unit of effort.
OVER = {"effort_per_force": "N", "effort_per_torque": "N m", "hold": ""}


def figure_of_workspace(found: Workspace, *, title: str = "", unit: str = "N or N m") -> Figure:
    """Draw the maps of a workspace, one row per measure, with slices of the third coordinate side by side.

    Args:
        found: The workspace, swept over one to three coordinates (of further coordinates, only
            the samples at the origin are drawn).
        title: Title of the figure.
        unit: Unit of the motors' efforts.

    Raises:
        HybridynError: matplotlib is missing.
    """
    maps = _maps(found)
    axes = found.sweep.axes[:3]
    here = (found.index[:, 3:] == 0).all(axis=1)
    levels = _levels(found.index[here, 2]) if len(axes) == 3 else [None]
    figure = empty_figure(3.1 * len(levels) + 1.4, 2.7 * len(maps) + 0.5)
    panels = figure.subplots(len(maps), len(levels), squeeze=False, sharex=True, sharey=len(axes) > 1)
    labels = {name: _label(name, unit) for name in maps}
    for number, (row, (name, values)) in enumerate(zip(panels, maps.items(), strict=True)):
        finite = values[np.isfinite(values)]
        # Clip the colour scale: a few postures near a singularity would otherwise dominate it.
        share = 100 if name == "conditioning" else 98
        limit = float(np.percentile(finite, share)) if len(finite) else None
        image: Any = None
        for ax, level in zip(row, levels, strict=True):
            chosen = here if level is None else here & (found.index[:, 2] == level)
            if len(axes) == 1:
                ax.plot(found.coordinates[chosen][:, _column(found, axes[0])], values[chosen], ".-")
                ax.set_ylabel(labels[name], fontsize="x-small")
            else:
                image = _image(ax, found, chosen, values, limit)
            if level is not None and number == 0:
                at = found.start[_column(found, axes[2])] + level * found.steps[2]
                ax.set_title(f"{axes[2]} = {at:.4g} {_unit(axes[2])}", fontsize="small")
            ax.tick_params(labelsize="x-small")
        if image is not None:
            figure.colorbar(image, ax=list(row), label=labels[name], shrink=0.9)
            row[0].set_ylabel(f"{axes[1]} [{_unit(axes[1])}]")
    for ax in panels[-1]:
        ax.set_xlabel(f"{axes[0]} [{_unit(axes[0])}]")
    figure.suptitle(title)
    return figure


def _label(name: str, unit: str) -> str:
    """Return the label of a map with its unit."""
    if name not in OVER:
        return LABELS[name]
    over = OVER[name]
    whole = f"({unit})/({over})" if over and " " in unit + over else f"{unit}/{over}" if over else unit
    return f"{LABELS[name]} [{whole}]"


def _maps(found: Workspace) -> dict[str, Array]:
    """Return the maps by name; the map of gravity efforts is the maximum over the motors."""
    maps = {name: values for name, values in found.measures.items() if name in LABELS and values.any()}
    held = [values for name, values in found.measures.items() if name.endswith("/effort")]
    if held:
        maps["hold"] = np.abs(held).max(axis=0)
    return maps


def _levels(index: Array) -> list[int]:
    """Choose evenly spaced values among the reached ones."""
    values = np.unique(index)
    if len(values) <= SLICES:
        return [int(value) for value in values]
    places = np.linspace(0, len(values) - 1, SLICES + 2)
    return [int(values[round(at)]) for at in places[1:-1]]  # the ends are often single points


def _image(ax: Axes, found: Workspace, chosen: Array, values: Array, high: float | None) -> Any:
    """Draw one slice as cells of the lattice; cells that were not reached stay white."""
    index = found.index[chosen][:, :2]
    lower, upper = found.index[:, :2].min(axis=0), found.index[:, :2].max(axis=0)
    picture = np.full(upper - lower + 1, np.nan)
    picture[tuple((index - lower).T)] = values[chosen]
    columns = [_column(found, axis) for axis in found.sweep.axes[:2]]
    first, last = (
        found.start[columns] + (end + half) * found.steps[:2] for end, half in ((lower, -0.5), (upper, 0.5))
    )
    ax.set_aspect("equal" if len({_unit(axis) for axis in found.sweep.axes[:2]}) == 1 else "auto")
    return ax.imshow(
        np.ma.masked_invalid(picture.T),
        origin="lower",
        extent=(first[0], last[0], first[1], last[1]),
        vmin=0.0,
        vmax=high,
        interpolation="nearest",
    )


def _column(found: Workspace, axis: str) -> int:
    return found.sweep.names.index(axis)


def _unit(axis: str) -> str:
    return "m" if COORDINATES.index(axis) < 3 else "rad"
