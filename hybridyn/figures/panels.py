"""Contents of a figure as plain data: panels of lines over time, or of bars."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..spatial import Array

#: A limit is drawn if the largest value is within this factor of it.
LIMIT_FACTOR = 2.5


@dataclass(frozen=True, eq=False)
class Line:
    """One line of a panel, or one bar per tick.

    Attributes:
        name: Name in the legend.
        y: Values, shape (T,) or (ticks,).
        limit: Largest permitted magnitude of the values, inf if there is none.
        mark_peak: Whether the value of largest magnitude is marked.
        bound: Half of the interval that is drawn about each bar, shape (ticks,), or None.
    """

    name: str
    y: Array
    limit: float = np.inf
    mark_peak: bool = False
    bound: Array | None = None

    @property
    def peak(self) -> int:
        """Index of the value of largest magnitude."""
        return int(np.argmax(np.abs(self.y)))

    @property
    def is_near_limit(self) -> bool:
        """Whether the limit is close enough to be drawn without flattening the line."""
        return self.limit <= LIMIT_FACTOR * float(np.abs(self.y).max(initial=0.0))


@dataclass(frozen=True, eq=False)
class Mark:
    """Points or a line at abscissas of its own.

    Attributes:
        name: Name in the legend, which all panels share.
        x: Abscissas, shape (T,).
        y: Values, shape (T,).
        style: "dots", "peak" (a triangle), "solid" or "dashed" (lines).
        colour: Its colour, "#rrggbb".
    """

    name: str
    x: Array
    y: Array
    style: str
    colour: str


@dataclass(frozen=True)
class Panel:
    """One panel: of lines over the abscissas of the chart, of bars, or of marks.

    Attributes:
        title: Title, for example the name of a module.
        label: Quantity and unit.
        lines: Lines or bars.
        colour: Colour of the title, "#rrggbb", or None.
        unit: Unit of the values, shown at marked peaks.
        logarithmic: Whether values are drawn on a logarithmic scale.
        ticks: Names below the bars; empty for a panel of lines.
        marks: Points and lines with abscissas of their own.
        x_label: Quantity and unit of these abscissas.
    """

    title: str
    label: str
    lines: tuple[Line, ...]
    colour: str | None = None
    unit: str = ""
    logarithmic: bool = False
    ticks: tuple[str, ...] = ()
    marks: tuple[Mark, ...] = ()
    x_label: str = ""

    @property
    def peak(self) -> float:
        """Largest magnitude of any value."""
        return max((float(np.abs(line.y).max(initial=0.0)) for line in self.lines), default=0.0)

    def limits(self) -> list[tuple[float, int | None]]:
        """Return the limits close to a line, with the number of the line, or None if all lines share it."""
        near = {line.limit: number for number, line in enumerate(self.lines) if line.is_near_limit}
        shared = len({line.limit for line in self.lines}) == 1
        return [(limit, None if shared else number) for limit, number in sorted(near.items())]

    def far_limits(self) -> str:
        """Describe briefly the limits that are too far away to be drawn."""
        near = {limit for limit, _ in self.limits()}
        far = sorted({line.limit for line in self.lines} - near - {np.inf})
        if not far:
            return ""
        size = f"{far[0]:.4g}" if len(far) == 1 else f"{far[0]:.4g} to {far[-1]:.4g}"
        return f"limit {size} {self.unit}"


@dataclass(frozen=True, eq=False)
class Chart:
    """A figure.

    Attributes:
        title: Title of the figure.
        x: Abscissas of the lines (time or row number), shape (T,).
        x_label: Quantity and unit of `x`.
        panels: Panels of the figure.
        across: Number of columns of panels, or None for a number that suits time series.
    """

    title: str
    x: Array
    x_label: str
    panels: tuple[Panel, ...]
    across: int | None = None

    @property
    def over_time(self) -> bool:
        """Whether all panels have the abscissas of the chart."""
        return not any(panel.ticks or panel.marks for panel in self.panels)

    @property
    def columns(self) -> int:
        """Number of columns of panels."""
        if self.across is not None:
            return self.across
        return 1 if len(self.panels) <= 4 else 2 if len(self.panels) <= 12 else 3
