"""Contents of a figure as plain data: panels of marks, which are lines, points or bars."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ..spatial import Array


@dataclass(frozen=True, eq=False)
class Mark:
    """A line, points, or a bar per name.

    Attributes:
        name: Name in the legend, or "" for none.
        x: Abscissas, shape (T,), or the names below bars.
        y: Values, shape (T,).
        style: "solid" or "dashed" (lines), "front" or "open" (lines with filled or open dots), "dots", "dot"
            (larger), "ring" (around a dot), "pale" (dots behind others), or "bar".
        colour: Its colour, "#rrggbb".
    """

    name: str
    x: Array | Sequence[str]
    y: Array
    style: str
    colour: str


@dataclass(frozen=True, eq=False)
class Panel:
    """One panel.

    Attributes:
        title: Title, for example the name of a module.
        label: Quantity and unit of the values.
        marks: What it shows.
        x_label: Quantity and unit of the abscissas, where the chart has none.
        colour: Colour of the title, "#rrggbb".
        logarithmic: Which scales are logarithmic: "", "y" (that of the values) or "xy".
    """

    title: str
    label: str
    marks: Sequence[Mark]
    x_label: str = ""
    colour: str = "#222222"
    logarithmic: str = ""


@dataclass(frozen=True, eq=False)
class PanelFigure:
    """A figure.

    Attributes:
        title: Title of the figure.
        panels: Panels of the figure.
        x_label: Quantity and unit of the abscissas that all panels share, "" where each has its own.
        across: Number of columns of panels, or None for a number that suits time series.
        size: Width and height of a panel that has its own abscissas [inch].
    """

    title: str
    panels: Sequence[Panel]
    x_label: str = ""
    across: int | None = None
    size: tuple[float, float] = (2.6, 2.5)

    @property
    def columns(self) -> int:
        """Number of columns of panels."""
        count = len(self.panels)
        return self.across or (1 if count <= 4 else 2 if count <= 12 else 3)

    @property
    def rows(self) -> int:
        """Number of rows of panels."""
        return max(-(-len(self.panels) // self.columns), 1)
