"""Reduce the rows of a table of any length to as many as a figure can show, without losing a peak."""

from __future__ import annotations

import numpy as np

from ..spatial import Array

#: Samples, or pairs of extremes, that are kept. A figure has fewer pixels.
MOST = 4000


class Envelope:
    """Rows of a table, or the minimum and maximum of groups of consecutive rows if there are too many."""

    def __init__(self, most: int = MOST) -> None:
        self._most, self._each = most, 1
        self._x: list[Array] = []
        self._low: list[Array] = []
        self._high: list[Array] = []
        self._rest: tuple[Array, Array] | None = None

    def add(self, x: Array, rows: Array) -> None:
        """Add consecutive rows.

        Args:
            x: Abscissas of the rows (time or row number), shape (T,).
            rows: Their values, shape (T, columns).
        """
        if self._rest is not None:
            x, rows = np.concatenate([self._rest[0], x]), np.concatenate([self._rest[1], rows])
        whole = len(x) - len(x) % self._each
        self._rest = (x[whole:], rows[whole:]) if whole < len(x) else None
        self._keep(x[: whole : self._each], rows[:whole], rows[:whole], self._each)
        while sum(map(len, self._x)) > 2 * self._most:
            self._halve()

    def _keep(self, x: Array, low: Array, high: Array, each: int) -> None:
        if len(x):
            self._x.append(x)
            self._low.append(low.reshape(-1, each, low.shape[1]).min(axis=1))
            self._high.append(high.reshape(-1, each, high.shape[1]).max(axis=1))

    def _halve(self) -> None:
        """Merge every two consecutive pairs of extremes into one."""
        x, low, high = (np.concatenate(parts) for parts in (self._x, self._low, self._high))
        even = len(x) - len(x) % 2
        self._x, self._low, self._high = [], [], []
        self._keep(x[:even:2], low[:even], high[:even], 2)
        if even < len(x):
            self._keep(x[even:], low[even:], high[even:], 1)
        self._each *= 2

    def lines(self) -> tuple[Array, Array]:
        """Return the points to draw: abscissas, shape (n,), and values, shape (n, columns)."""
        x, low, high = [*self._x], [*self._low], [*self._high]
        if self._rest is not None:
            x.append(self._rest[0][:1])
            low.append(self._rest[1].min(axis=0, keepdims=True))
            high.append(self._rest[1].max(axis=0, keepdims=True))
        if not x:
            return np.zeros(0), np.zeros((0, 0))
        places, lows, highs = (np.concatenate(parts) for parts in (x, low, high))
        if self._each == 1:
            return places, lows
        both = np.stack([lows, highs], axis=1).reshape(-1, lows.shape[1])
        return np.repeat(places, 2), both
