"""What the results say: fronts of error against time, the cheapest setting for an error, fitted exponents."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any, TypeVar

import numpy as np

from benchmarks.results import Row

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


def cheapest(rows: Iterable[Row], error: float = GOOD) -> Row | None:
    """Return the fastest row that reaches an error, else the most accurate one, None without any."""
    measured = [row for row in rows if math.isfinite(row.us)]
    good = [row for row in measured if row.error <= error]
    if good:
        return min(good, key=lambda row: row.us)
    return min(measured, key=lambda row: row.error, default=None)


def exponent(at: Sequence[float], values: Sequence[float]) -> float:
    """Fit value = c at^p and give p, over the larger cases."""
    pairs = [(x, y) for x, y in zip(at, values, strict=True) if x >= FITTED_FROM and 0 < y < math.inf]
    if len(pairs) < 2:
        return math.nan
    x, y = np.log(np.array(pairs)).T
    return float(np.polyfit(x, y, 1)[0])


def grouped(rows: Iterable[Item], *names: str) -> dict[Any, list[Item]]:
    """Group rows by some of their fields, in order of appearance; one field gives plain keys."""
    out: dict[Any, list[Item]] = {}
    for row in rows:
        key = tuple(getattr(row, name) for name in names)
        out.setdefault(key if len(names) > 1 else key[0], []).append(row)
    return out


def chosen(rows: Iterable[Row], method: str = "", **wanted: Any) -> list[Row]:
    """Return the rows with some values in their fields, whose method begins with a word."""
    return [
        row
        for row in rows
        if row.method.startswith(method) and all(getattr(row, name) == x for name, x in wanted.items())
    ]
