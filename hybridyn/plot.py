"""Figures of tables: positions, efforts, energies and residuals against time.

Figures are matplotlib's `Figure` without pyplot: nothing opens a window, and nothing is left in memory.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from .description.columns import ENERGIES, RESIDUAL
from .errors import TrajectoryError
from .spatial import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Endings that `save` writes.
FORMATS = (".png", ".svg", ".pdf")

PANELS = (
    ("position", "position [m or rad]"),
    ("velocity", "velocity [m/s or rad/s]"),
    ("acceleration", "acceleration [m/s^2 or rad/s^2]"),
    ("effort", "effort [N or N m]"),
)


def figure_of_table(columns: Sequence[str], rows: Array, *, title: str = "") -> Figure:
    """Draw a table of a motion: one panel per quantity, time across.

    Where the table holds efforts, joints without one (passive ones) are left out, so that motors can be seen.

    Args:
        columns: Names of the columns ("<joint>/effort", "energy/total", ...).
        rows: The rows, shape (T, columns).
        title: Title of the figure.

    Raises:
        TrajectoryError: No column can be drawn, or matplotlib is missing.
    """
    data = dict(zip(columns, rows.T, strict=True))
    across = data.get("time", np.arange(len(rows), dtype=float))
    panels = [(label, lines) for part, label in PANELS if (lines := _of_joints(data, part))]
    energies = {name.partition("/")[2]: data[name] for name in ENERGIES if name in data}
    if energies:
        panels.append(("energy [J]", energies))
    residual = {"residual": data[RESIDUAL]} if RESIDUAL in data else {}
    if not panels:
        raise TrajectoryError("no column of a joint and no energy to draw")
    figure = _figure(len(panels) + bool(residual))
    axes = figure.subplots(len(panels) + bool(residual), 1, sharex=True, squeeze=False)[:, 0]
    for ax, (label, lines) in zip(axes, panels, strict=False):
        _draw(ax, across, lines, label)
    if residual:
        # An exact zero has no logarithm; the smallest normal rounding stands for it.
        _draw(axes[-1], across, {"": np.maximum(data[RESIDUAL], 1e-17)}, "residual")
        axes[-1].set_yscale("log")
    axes[-1].set_xlabel("time [s]" if "time" in data else "row")
    axes[0].set_title(title)
    return figure


def _of_joints(data: dict[str, Array], part: str) -> dict[str, Array]:
    """Give one quantity of every joint, or of the motors where efforts tell them."""
    motors = {name.partition("/")[0] for name in data if name.endswith("/effort")}
    ending = f"/{part}"
    found = {name.removesuffix(ending): x for name, x in data.items() if name.endswith(ending)}
    return {name: x for name, x in found.items() if not motors or name in motors}


def _figure(panels: int) -> Figure:
    """Give an empty figure, or say how to install matplotlib."""
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        message = "figures need matplotlib: install it with `pip install 'hybridyn[plot]'`"
        raise TrajectoryError(message) from error
    return Figure(figsize=(9.0, 2.4 * panels), layout="constrained")


def _draw(ax: Axes, across: Array, lines: dict[str, Array], label: str) -> None:
    """Draw one panel; many lines share a legend beside it."""
    for name, x in lines.items():
        ax.plot(across, x, label=name or None, linewidth=1.2)
    ax.set_ylabel(label)
    ax.grid(visible=True, alpha=0.3)
    if any(lines):
        ax.legend(
            loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize="x-small", ncols=1 + len(lines) // 13
        )
