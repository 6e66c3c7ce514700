"""Where the names of curves go: beside an end where there is room, else in a column on the right."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

#: Width of a letter of size 8 [points].
LETTER = 4.3
#: Height of a line.
LINE = 11.0
#: Least vertical distance of two names in the column.
CROWDED = 12.0
#: Between a point and its name.
GAP = 5.0


class Box(NamedTuple):
    """A rectangle [points]."""

    left: float
    low: float
    right: float
    high: float

    def meets(self, other: Box) -> bool:
        """Tell whether two rectangles overlap."""
        return (
            self.left < other.right
            and other.left < self.right
            and self.low < other.high
            and other.low < self.high
        )

    def holds(self, other: Box) -> bool:
        """Tell whether another rectangle lies within."""
        return (
            self.left <= other.left
            and other.right <= self.right
            and self.low <= other.low
            and other.high <= self.high
        )


def around(x: float, y: float, reach: float) -> Box:
    """Return the square about a point."""
    return Box(x - reach, y - reach, x + reach, y + reach)


def beside(point: tuple[float, float], text: str, taken: Sequence[Box], panel: Box) -> Box | None:
    """Return room for a name next to a point: right, left, above or below it; None where there is none.

    Args:
        point: Where the curve is [points].
        text: The name.
        taken: What must not be covered.
        panel: Where names may stand.
    """
    x, y = point
    width = LETTER * len(text)
    places = [
        Box(x + GAP, y - LINE / 2, x + GAP + width, y + LINE / 2),
        Box(x - GAP - width, y - LINE / 2, x - GAP, y + LINE / 2),
        Box(x - width / 2, y + GAP, x + width / 2, y + GAP + LINE),
        Box(x - width / 2, y - GAP - LINE, x + width / 2, y - GAP),
        Box(x - GAP, y + GAP, x - GAP + width, y + GAP + LINE),
        Box(x - GAP, y - GAP - LINE, x - GAP + width, y - GAP),
    ]
    free = (place for place in places if panel.holds(place) and not any(map(place.meets, taken)))
    return next(free, None)


def spread(wanted: Any, apart: float, low: float, high: float) -> Any:
    """Move heights as little as it takes to keep them apart, within a range where they fit."""
    out = np.array(wanted, dtype=float)
    if not len(out):
        return out
    order = np.argsort(out)
    for before, at in pairwise(order):
        out[at] = max(out[at], out[before] + apart)
    excess = out[order[-1]] - max(high, low + apart * (len(out) - 1))
    if excess > 0:
        out[order[-1]] -= excess
        for after, at in pairwise(order[::-1]):
            out[at] = min(out[at], out[after] - apart)
    return out
