"""Maps of a workspace: conditioning and holding efforts over one, two or (as slices) three coordinates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..linkage.targets import COORDINATES
from ..spatial import Array, Index
from .as_matplotlib import empty_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Largest number of slices along the third coordinate.
SLICES = 5
#: Coordinates that differ by less are equal: rounding of the assembly [m, rad].
SAME = 1e-7
#: Decimals of coordinates that count.
DIGITS = 7
LABELS = {
    "conditioning": "conditioning [-], 1 is isotropic",
    "effort_per_force": "largest effort per N of force [{} per N]",
    "effort_per_torque": "largest effort per N m of torque [{} per N m]",
    "hold": "largest effort against gravity [{}]",
}


def figure_of_workspace(
    coordinates: Mapping[str, Array], measures: Mapping[str, Array], *, title: str = "",
    unit: str = "N or N m", ends: Mapping[str, Mapping[str, Array]] | None = None,
) -> Figure:  # fmt: skip
    """Draw the maps of a workspace, one row per measure, with slices of the third coordinate side by side.

    Args:
        coordinates: Coordinates of the poses by name, shape (n,) each, [m, rad]; those that vary are drawn,
            up to three. Of a lattice in more of them, only the middle of the others is drawn.
        measures: Measures of the poses by name, shape (n,) each.
        title, unit: Title of the figure, and unit of the motors' efforts.
        ends: What ends the workspace to where it does, coordinates by name as for the poses; they are marked
            in the first row.

    Raises:
        HybridynError: matplotlib is missing.
    """
    maps = {name: values for name, values in measures.items() if name in LABELS and values.any()}
    held = [np.abs(values) for name, values in measures.items() if name.endswith("/effort")]
    maps |= {"hold": np.max(held, axis=0)} if held else {}
    lattice = _Lattice(coordinates)
    axes, index = lattice.axes[:3], lattice.index
    here = (index[:, 3:] == lattice.middle).all(axis=1)
    levels = _levels(index[here, 2]) if len(axes) == 3 else [None]
    figure = empty_figure(3.1 * len(levels) + 1.4, 2.7 * len(maps) + 0.5)
    panels = figure.subplots(len(maps), len(levels), squeeze=False, sharex=True, sharey=len(axes) > 1)
    slices = [here if level is None else here & (index[:, 2] == level) for level in levels]
    for row, (name, values) in zip(panels, maps.items(), strict=True):
        label = LABELS[name].format(unit)
        if len(axes) == 1:
            row[0].plot(coordinates[axes[0]][here], values[here], ".-")
            row[0].set_ylabel(label, fontsize="x-small")
            row[0].tick_params(labelsize="x-small")
        else:
            _draw_slices(figure, row, lattice, slices, values, label, 100 if name == "conditioning" else 98)
    _label_slices(figure, panels[0], lattice, levels, ends or {})
    for ax in panels[-1]:
        ax.set_xlabel(f"{axes[0]} [{_unit(axes[0])}]")
    figure.suptitle(title)
    return figure


class _Lattice:
    """The lattice of some poses.

    Attributes:
        axes: The coordinates that vary; the first one where none does.
        start: Their least values, shape (axes,), [m, rad].
        steps: Their steps, shape (axes,), [m, rad].
        index: Steps of each pose from `start`, shape (n, axes).
        middle: Of the axes after the third, the step that is drawn.
    """

    def __init__(self, coordinates: Mapping[str, Array]) -> None:
        varying = [name for name, values in coordinates.items() if np.ptp(values) > SAME]
        self.axes = varying or [*coordinates][:1]
        values = np.column_stack([coordinates[name] for name in self.axes])
        self.start = values.min(axis=0)
        different = (np.unique(column.round(DIGITS)) for column in values.T)
        self.steps = np.array([np.diff(column).min(initial=np.inf) for column in different])
        self.steps[np.isinf(self.steps)] = 1.0
        self.index = np.rint(self.steps_to(coordinates)).astype(int)
        self.middle = np.median(self.index[:, 3:], axis=0).round()

    def steps_to(self, coordinates: Mapping[str, Array]) -> Array:
        """Return how many steps coordinates are from the start, shape (n, axes); halves lie between poses."""
        values = np.column_stack([coordinates[name] for name in self.axes])
        return np.asarray((values - self.start) / self.steps)


def _label_slices(
    figure: Figure,
    row: Sequence[Axes],
    lattice: _Lattice,
    levels: Sequence[Any],
    ends: Mapping[str, Mapping[str, Array]],
) -> None:
    """Write over each slice its third coordinate, and mark what ends the workspace in it."""
    for ax, level in zip(row, levels, strict=True):
        _mark(ax, lattice, lattice.middle if level is None else [level, *lattice.middle], ends)
        if level is not None:
            at = (lattice.start[2] + level * lattice.steps[2]).round(DIGITS) + 0.0
            ax.set_title(f"{lattice.axes[2]} = {at:.4g} {_unit(lattice.axes[2])}", fontsize="small")
    if ends:
        marks = row[0].get_legend_handles_labels()
        figure.legend(*marks, loc="outside lower center", ncols=len(levels) + 1, fontsize="x-small")


def _mark(
    ax: Axes, lattice: _Lattice, fixed: Sequence[float], ends: Mapping[str, Mapping[str, Array]]
) -> None:
    """Mark what ends the workspace in a slice; `fixed` are its other coordinates, in steps of the lattice."""
    drawn = len(lattice.axes) - len(fixed)
    for reason, coordinates in ends.items():
        off = np.abs(lattice.steps_to(coordinates)[:, drawn:] - fixed).max(axis=1, initial=0.0)
        here = [coordinates[name][off < 0.25] for name in lattice.axes[:drawn]]
        height = here[1] if drawn > 1 else np.zeros(len(here[0]))
        ax.scatter(here[0], height, s=6.0, linewidths=0.0, label=reason, zorder=3)


def _levels(index: Index) -> list[Any]:
    """Choose evenly spaced values among the reached ones, without the ends, which are often single points."""
    values = np.unique(index)
    places = np.linspace(0, len(values) - 1, SLICES + 2)[1:-1].round().astype(int)
    return list(values if len(values) <= SLICES else values[places])


def _limit(values: Array, share: float) -> float:
    """Return the upper end of a colour scale from zero: of zeros alone, one, so that all slices have it.

    A share [%] of the values is within: a few near a singularity would otherwise dominate it.
    """
    clipped = float(np.percentile(values, share)) if len(values) else 0.0
    return clipped or float(values.max(initial=0.0)) or 1.0


def _draw_slices(
    figure: Figure,
    row: Any,
    lattice: _Lattice,
    slices: Sequence[Array],
    values: Array,
    label: str,
    share: float,
) -> None:
    """Draw the slices of one measure side by side, with one colour scale over a share [%] of its values."""
    limit = _limit(values[np.isfinite(values)], share)
    images = [_image(ax, lattice, at, values, limit) for ax, at in zip(row, slices, strict=True)]
    figure.colorbar(images[-1], ax=list(row), shrink=0.9).set_label(label, size="x-small")
    row[0].set_ylabel(f"{lattice.axes[1]} [{_unit(lattice.axes[1])}]")
    for ax in row:
        ax.tick_params(labelsize="x-small")


def _image(ax: Axes, lattice: _Lattice, chosen: Array, values: Array, high: float) -> Any:
    """Draw one slice as cells of the lattice; cells that were not reached stay white."""
    index = lattice.index[chosen][:, :2]
    upper = lattice.index[:, :2].max(axis=0)
    picture = np.full(upper + 1, np.nan)
    picture[tuple(index.T)] = values[chosen]
    start, steps = lattice.start[:2], lattice.steps[:2]
    first, last = start - steps / 2, start + (upper + 0.5) * steps
    return ax.imshow(
        np.ma.masked_invalid(picture.T),
        origin="lower",
        extent=(first[0], last[0], first[1], last[1]),
        vmin=0.0,
        vmax=high,
        interpolation="nearest",
        aspect="equal" if len({_unit(axis) for axis in lattice.axes[:2]}) == 1 else "auto",
    )


def _unit(axis: str) -> str:
    return "m" if COORDINATES.index(axis) < 3 else "rad"
