"""What a figure shows, as plain data: panels of lines over time, or of bars."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..spatial import Array

#: A limit is drawn if values come within this factor of it.
LIMIT_FACTOR = 2.5


@dataclass(frozen=True)
class Line:
    """One line of a panel, or one bar per tick.

    Attributes:
        name: Its name in the legend.
        y: Its values, shape (T,) or (ticks,).
        limit: Largest size that its values may have, inf where there is none.
        mark_peak: Whether its largest size is marked.
    """

    name: str
    y: Array
    limit: float = np.inf
    mark_peak: bool = False

    @property
    def peak(self) -> int:
        """Number of its value of the largest size."""
        return int(np.argmax(np.abs(self.y)))

    @property
    def is_near_limit(self) -> bool:
        """Whether its limit is near enough to be drawn without squashing it."""
        return self.limit <= LIMIT_FACTOR * float(np.abs(self.y).max(initial=0.0))


@dataclass(frozen=True)
class Panel:
    """One panel.

    Attributes:
        title: What it is about.
        label: Quantity and unit.
        lines: Its lines.
        colour: Colour of what it is about, "#rrggbb", or None.
        unit: Unit of its values, for marked peaks.
        logarithmic: Whether values are drawn on a logarithmic scale.
        ticks: Names under its bars; a panel of lines has none.
    """

    title: str
    label: str
    lines: tuple[Line, ...]
    colour: str | None = None
    unit: str = ""
    logarithmic: bool = False
    ticks: tuple[str, ...] = ()

    @property
    def peak(self) -> float:
        """Largest size of any value."""
        return max((float(np.abs(line.y).max(initial=0.0)) for line in self.lines), default=0.0)

    def limits(self) -> list[tuple[float, int | None]]:
        """Return the limits that lines come near to, with the line's number, or None where all share it."""
        near = {line.limit: number for number, line in enumerate(self.lines) if line.is_near_limit}
        shared = len({line.limit for line in self.lines}) == 1
        return [(limit, None if shared else number) for limit, number in sorted(near.items())]

    def far_limits(self) -> str:
        """Say in a few words which limits are too far away to be drawn."""
        near = {limit for limit, _ in self.limits()}
        far = sorted({line.limit for line in self.lines} - near - {np.inf})
        if not far:
            return ""
        size = f"{far[0]:.4g}" if len(far) == 1 else f"{far[0]:.4g} to {far[-1]:.4g}"
        return f"limit {size} {self.unit}"


@dataclass(frozen=True)
class Chart:
    """A figure.

    Attributes:
        title: Its title.
        x: What lines are drawn over, shape (T,).
        x_label: Its quantity and unit.
        panels: Its panels.
    """

    title: str
    x: Array
    x_label: str
    panels: tuple[Panel, ...]

    @property
    def columns(self) -> int:
        """How many panels stand side by side."""
        return 1 if len(self.panels) <= 4 else 2 if len(self.panels) <= 12 else 3
