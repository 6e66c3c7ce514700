"""Interpolate samples over time by quintic splines, without the half second that importing SciPy's takes.

The spline is that of `scipy.interpolate.make_interp_spline` with degree 5: its knots are the sampled times
without the second and third at either end. The matrix of the B-splines at these times is banded and totally
positive, so that elimination without pivots between blocks of rows is stable (de Boor and Pinkus, 1977).
"""

from __future__ import annotations

import itertools

import numpy as np

from ..description.records import Array
from ..spatial import Index

#: Degree of the splines: accelerations are then smooth, with an error of the fourth order of the step.
DEGREE = 5
#: Rows of a block of the elimination; blocks of about this size are quickest.
BLOCK = 64


class Spline:
    """A quintic spline through samples; call it with times and the order of a derivative.

    Args:
        time: Strictly increasing times, shape (rows,), [s]; at least six.
        values: Samples, shape (rows, n).
        first_row: Number of the first row in a table. Blocks of the elimination begin at multiples of
            `BLOCK`, so that rounding inside a window does not depend on where the window begins.

    Raises:
        ValueError: The times are too close together or too far apart.
    """

    def __init__(self, time: Array, values: Array, first_row: int = 0) -> None:
        half = (DEGREE + 1) // 2
        ends = np.repeat(time[[0, -1]], DEGREE + 1).reshape(2, -1)
        self._knots = np.concatenate([ends[0], time[half:-half], ends[1]])
        spans, weights = self._basis(time, DEGREE)
        if not np.isfinite(weights).all():
            raise ValueError("the times are too close together or too far apart")
        self._levels = [_solved(spans, weights, values, -first_row % BLOCK)]

    def __call__(self, time: Array, order: int = 0) -> Array:
        """Compute a derivative of the spline, shape (T, n).

        Args:
            time: Times within those of the samples, shape (T,), [s].
            order: Order of the derivative; 0 for the value.
        """
        degree = DEGREE - order
        spans, weights = self._basis(time, degree)
        coefficients = self._coefficients(order)
        out: Array = np.zeros((len(time), coefficients.shape[1]))
        for j in range(degree + 1):
            out += weights[j, :, None] * coefficients[spans - degree + j]
        return out

    def _coefficients(self, order: int) -> Array:
        """Return the coefficients of a derivative on the same knots, shape (rows, n)."""
        while len(self._levels) <= order:
            lower = self._levels[-1]
            d = len(self._levels)
            degree = DEGREE + 1 - d
            j = np.arange(d, len(lower))
            out = np.zeros_like(lower)
            width = self._knots[j + degree] - self._knots[j]
            out[d:] = degree * np.diff(lower[d - 1 :], axis=0) / width[:, None]
            self._levels.append(out)
        return self._levels[order]

    def _basis(self, time: Array, degree: int) -> tuple[Index, Array]:
        """Compute the B-splines that are not zero, by the recursion of Cox and de Boor.

        Returns:
            The span of each time, shape (T,), and the values of B-splines span - degree to span, shape
            (degree + 1, T).
        """
        t, rows = self._knots, len(self._knots) - DEGREE - 1
        spans = np.clip(np.searchsorted(t, time, side="right") - 1, DEGREE, rows - 1)
        weights = np.zeros((degree + 1, len(time)))
        weights[0] = 1.0
        right = [t[spans + 1 + r] - time for r in range(degree)]
        left = [time - t[spans - r] for r in range(degree)]
        for j in range(1, degree + 1):
            saved: Array | float = 0.0
            for r in range(j):
                part = weights[r] / (right[r] + left[j - 1 - r])
                weights[r] = saved + right[r] * part
                saved = left[j - 1 - r] * part
            weights[j] = saved
        return spans, weights


def _solved(spans: Index, weights: Array, values: Array, edge: int) -> Array:
    """Solve the banded equations of the coefficients by elimination of blocks of rows, shape (rows, n).

    `edge` is a row at which a block begins, below `BLOCK`; the last block is up to twice as large.
    """
    rows = len(values)
    edges = [0, *(at for at in range(edge, rows, BLOCK) if DEGREE <= at <= rows - BLOCK), rows]
    columns = spans[:, None] - DEGREE + np.arange(DEGREE + 1)
    done: list[Array] = []
    for first, stop in itertools.pairwise(edges):
        size, own = stop - first, np.arange(stop - first)[:, None]
        band = np.zeros((size, size + 2 * DEGREE))  # and as many columns of the blocks before and after
        band[own, columns[first:stop] - first + DEGREE] = weights[:, first:stop].T
        before, square, after = np.split(band, [DEGREE, DEGREE + size], axis=1)
        right = np.concatenate([after, values[first:stop]], axis=1)
        if done:
            last = done[-1][-DEGREE:]
            square = square.copy()
            square[:, :DEGREE] -= before @ last[:, :DEGREE]
            right[:, DEGREE:] -= before @ last[:, DEGREE:]
        done.append(np.linalg.solve(square, right))
    out = np.empty_like(values)
    following = np.zeros((DEGREE, values.shape[1]))
    for first, stop, block in zip(edges[-2::-1], edges[:0:-1], done[::-1], strict=True):
        out[first:stop] = block[:, DEGREE:] - block[:, :DEGREE] @ following
        following = out[first : first + DEGREE]
    return out
