"""What the results say: fronts of error against time, the cheapest setting for an error, fitted exponents."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any, TypeVar

import numpy as np

from benchmarks.results import Point

#: Modules: below, what every call costs once hides the slope.
FITTED_FROM = 4
#: The error that the speed goals ask of everybody.
GOOD = 1e-10

Item = TypeVar("Item")


def front(
    points: Iterable[Item], cost: Callable[[Item], float], error: Callable[[Item], float]
) -> list[Item]:
    """Return the points that no other beats in both cost and error, cheapest first."""
    out: list[Item] = []
    for one in sorted(points, key=lambda p: (cost(p), error(p))):
        if math.isfinite(error(one)) and (not out or error(one) < error(out[-1])):
            out.append(one)
    return out


def cheapest(points: Iterable[Point], error: float = GOOD) -> Point | None:
    """Return the fastest point that reaches an error, else the most accurate one, None without any."""
    measured = [point for point in points if math.isfinite(point.us)]
    good = [point for point in measured if point.error <= error]
    if good:
        return min(good, key=lambda p: p.us)
    return min(measured, key=lambda p: p.error, default=None)


def exponent(at: Sequence[float], values: Sequence[float]) -> float:
    """Fit value = c at^p and give p, over the larger cases."""
    known = [(x, y) for x, y in zip(at, values, strict=True) if math.isfinite(y) and y > 0]
    pairs = [(x, y) for x, y in known if x >= FITTED_FROM]
    if len(pairs) < 2:
        return math.nan
    x, y = np.log(np.array(pairs)).T
    return float(np.polyfit(x, y, 1)[0])


def grouped(rows: Iterable[Any], *names: str) -> dict[Any, list[Any]]:
    """Group rows by some of their fields, in order of appearance; one field gives plain keys."""
    out: dict[Any, list[Any]] = {}
    for row in rows:
        key = tuple(getattr(row, name) for name in names)
        out.setdefault(key if len(names) > 1 else key[0], []).append(row)
    return out
