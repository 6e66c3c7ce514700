"""Means and peaks of columns over a motion, accumulated block by block in time order.

A mean is the time integral by the trapezoidal rule over the duration, so that it does not depend on how the
rows are spaced; without times, it is the plain mean over the rows. RMS values are roots of means of squares.
"""

from __future__ import annotations

import numpy as np

from ..spatial import Array

#: Peaks that differ by less than this (relative) count as equal and the first is used: rounding must not
#: decide.
TIE = 1e-6


def places(time: Array | None, first_row: int, rows: int) -> Array:
    """Return the times of consecutive rows, shape (rows,), [s], or their numbers where there are none."""
    return np.arange(first_row, first_row + rows, dtype=float) if time is None else time


class Means:
    """Means of columns over time, or over rows where there are no times.

    Attributes:
        duration: Time from the first row to the last [s]; 0 without times.
    """

    def __init__(self) -> None:
        self.duration = 0.0
        self._rows = 0
        self._sum: Array | float = 0.0
        self._integral: Array | float = 0.0
        self._last: tuple[float, Array] | None = None

    def add(self, time: Array | None, values: Array) -> None:
        """Add consecutive rows, shape (T, ...), at times, shape (T,), [s], or None."""
        if not len(values):
            return
        self._rows += len(values)
        self._sum = self._sum + values.sum(axis=0)
        if time is None:
            return
        if self._last is not None:
            time, values = np.r_[self._last[0], time], np.concatenate([self._last[1][None], values])
        steps = np.einsum("t,t...->...", np.diff(time), values[1:] + values[:-1]) / 2
        self._integral = self._integral + steps
        self.duration += float(time[-1] - time[0])
        self._last = (float(time[-1]), values[-1])

    @property
    def integral(self) -> Array:
        """Integrals over time, shape (...)."""
        return np.asarray(self._integral)

    @property
    def mean(self) -> Array:
        """Means, shape (...); 0 without rows."""
        if self.duration > 0:
            return self.integral / self.duration
        return np.asarray(self._sum) / max(self._rows, 1)


def mean_over(time: Array | None, values: Array) -> Array:
    """Compute the means of columns over time, shape (...).

    Args:
        time: Times, shape (T,), [s], or None.
        values: The columns, shape (T, ...).
    """
    means = Means()
    means.add(time, values)
    return means.mean


def rms_over(time: Array | None, values: Array) -> Array:
    """Compute the RMS values of columns over time, shape (...); arguments as `mean_over`."""
    return np.sqrt(mean_over(time, values**2))


class Peaks:
    """The value of largest magnitude of each column, with its sign, and its time or row.

    Attributes:
        value: The values, shape (columns,).
        at: Their times [s] or rows, shape (columns,); nan without samples.
    """

    def __init__(self, count: int) -> None:
        self.value, self.at = np.zeros(count), np.full(count, np.nan)

    def add(self, values: Array, at: Array) -> None:
        """Add samples, shape (T, columns), at times or rows, shape (T,)."""
        if not len(values):
            return
        sizes = np.abs(values)
        first = (sizes >= sizes.max(axis=0) * (1 - TIE)).argmax(axis=0)
        found = np.take_along_axis(values, first[None], axis=0)[0]
        better = np.isnan(self.at) | (np.abs(found) > np.abs(self.value) * (1 + TIE))
        self.value = np.where(better, found, self.value)
        self.at = np.where(better, at[first], self.at)
