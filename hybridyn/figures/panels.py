"""Contents of a figure as plain data: panels of marks, which are lines, points or bars."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..colours import ALARM, MODULES
from ..spatial import Array

#: A limit is drawn if the largest value is within this factor of it.
LIMIT_FACTOR = 2.5


@dataclass(frozen=True, eq=False)
class Mark:
    """A line, points, or a bar per name.

    Attributes:
        name: Name in the legend, or "" for none.
        x: Abscissas, shape (T,), or the names below bars.
        y: Values, shape (T,).
        style: "solid" or "dashed" (lines), "dots", "dot" (larger), or "bar".
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
        logarithmic: Whether values are drawn on a logarithmic scale.
    """

    title: str
    label: str
    marks: Sequence[Mark]
    x_label: str = ""
    colour: str = "#222222"
    logarithmic: bool = False


@dataclass(frozen=True, eq=False)
class Chart:
    """A figure.

    Attributes:
        title: Title of the figure.
        panels: Panels of the figure.
        x_label: Quantity and unit of the abscissas that all panels share, "" where each has its own.
        across: Number of columns of panels, or None for a number that suits time series.
    """

    title: str
    panels: Sequence[Panel]
    x_label: str = ""
    across: int | None = None

    @property
    def columns(self) -> int:
        """Number of columns of panels."""
        count = len(self.panels)
        return self.across or (1 if count <= 4 else 2 if count <= 12 else 3)

    @property
    def rows(self) -> int:
        """Number of rows of panels."""
        return max(-(-len(self.panels) // self.columns), 1)


def with_limits(
    title: str,
    label: str,
    x: Array,
    lines: dict[str, Array],
    limits: Sequence[float],
    unit: str,
    colour: str,
) -> Panel:
    """Build a panel of lines with their peaks marked, and the limits near them; others are in the title.

    Args:
        x: Abscissas, shape (T,).
        lines: Values by name, shape (T,) each.
        limits: Largest permitted magnitude of each line, inf if there is none.
        unit: Unit of the values.
    """
    marks, drawn, far = [], {}, set()
    for number, ((name, y), limit) in enumerate(zip(lines.items(), limits, strict=True)):
        own = MODULES[number % len(MODULES)]
        at = int(np.abs(y).argmax())
        marks.append(Mark(f"{name}, peak {y[at]:.4g}" if y[at] else name, x, y, "solid", own))
        if y[at]:
            marks.append(Mark("", x[[at]], y[[at]], "dot", own))
        if limit <= LIMIT_FACTOR * abs(y[at]):
            drawn[limit] = ALARM if len({*limits}) == 1 else own
        elif limit < np.inf:
            far.add(limit)
    for limit, own in drawn.items():
        marks += [Mark("", x[[0, -1]], np.full(2, end), "dashed", own) for end in (-limit, limit)]
    if rest := sorted(far - drawn.keys()):
        size = f"{rest[0]:.4g}" if len(rest) == 1 else f"{rest[0]:.4g} to {rest[-1]:.4g}"
        title = f"{title} (limit {size} {unit})"
    return Panel(title, label, marks, colour=colour)
