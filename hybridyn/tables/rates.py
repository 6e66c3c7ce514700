"""Compute the rates that a table leaves out, from an interpolating quintic spline over time.

Rows are read in blocks, so that no spline can go through all of them at once. This is not needed either: the
influence of a row decays by a factor of about 0.43 per row (uniform steps), so that a window with `HALO` rows
on either side gives the same numbers as the whole table.

The spline is that of `scipy.interpolate.make_interp_spline` with degree 5, without the half second that
importing SciPy's takes: its knots are the sampled times without the second and third at either end. The
matrix of the B-splines at these times is banded and totally positive, so that elimination without pivots
between blocks of rows is stable (de Boor and Pinkus, 1977).
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np

from ..description.records import Array
from ..spatial import Index, cross
from .opening import Block

#: Degree of the splines: accelerations are then smooth, with an error of the fourth order of the step.
DEGREE = 5
#: Rows of a block of the elimination; blocks of about this size are quickest.
BLOCK = 64
FEWEST_ROWS = DEGREE + 1
#: Rows on either side of a block: 0.43 ** 128 = 1e-47; irregular steps need about 50 rows, measured.
HALO = 128


class Window(NamedTuple):
    """A block with its neighbours.

    Attributes:
        first_row: Number of the block's first row in the table.
        values: Rows of the block and its neighbours, shape (rows, columns).
        core: Slice of the block's own rows.
    """

    first_row: int
    values: Array
    core: slice


def windows(blocks: Iterable[Block], halo: int = HALO) -> Iterator[Window]:
    """Yield each block with up to `halo` rows of its neighbours on either side.

    Args:
        blocks: Blocks of consecutive rows.
        halo: Rows wanted on either side; fewer only at the ends of the table.
    """
    rows = np.empty((0, 0))
    start = 1  # number of the row that rows[0] is
    waiting: list[tuple[int, int]] = []  # first and one past last row of blocks not yielded yet
    for block in itertools.chain(blocks, [None]):
        if block is not None:
            rows = np.concatenate([rows, block.values]) if len(rows) else block.values
            waiting.append((block.first_row, block.first_row + len(block.values)))
        while waiting and (block is None or start + len(rows) >= waiting[0][1] + halo):
            first, stop = waiting.pop(0)
            low = max(first - halo - start, 0)
            core = slice(first - start - low, stop - start - low)
            yield Window(first, rows[low : stop + halo - start], core)
            unused = max(0, stop - halo - start)
            rows, start = rows[unused:], start + unused


def derivatives(time: Array, values: Array, core: slice, first_row: int = 0) -> tuple[Array, Array]:
    """Compute the first two time derivatives of sampled values, by an interpolating quintic spline.

    Args:
        time: Strictly increasing times, shape (rows,), [s]; at least `FEWEST_ROWS`.
        values: Samples, shape (rows, n).
        core: Rows whose derivatives are wanted.
        first_row: Number of the first row in its table, as in `Spline`.

    Returns:
        First and second derivatives, shape (core rows, n) each, [1/s], [1/s^2].
    """
    spline = Spline(time, values, first_row)
    return spline(time[core], 1), spline(time[core], 2)


def aligned(quaternions: Array) -> Array:
    """Choose the signs of quaternions such that neighbouring ones are near each other.

    Args:
        quaternions: Shape (rows, 4).

    Returns:
        The same rotations, shape (rows, 4).
    """
    flips = np.sum(quaternions[1:] * quaternions[:-1], axis=1) < 0
    signs = np.cumprod(np.where(np.concatenate([[False], flips]), -1.0, 1.0))
    return quaternions * signs[:, None]


def turns(quaternions: Array) -> Array:
    """Compute the angles between neighbouring rotations.

    Args:
        quaternions: Unit quaternions, shape (rows, 4).

    Returns:
        Angles, shape (rows - 1,), [rad], at most pi.
    """
    chords: Array = np.linalg.norm(np.diff(aligned(quaternions), axis=0), axis=1)
    return 4.0 * np.arcsin(np.minimum(chords / 2.0, 1.0))


def angular_rates(p: Array, p_dot: Array, p_ddot: Array) -> tuple[Array, Array]:
    """Compute angular velocity and acceleration from a quaternion whose length may vary.

    The rotation is that of p / |p|. With w = p_dot p^-1, the vector part of 2 w is omega for any |p(t)|;
    its derivative is w_dot = p_ddot p^-1 - w w.

    Args:
        p: Quaternions x, y, z, w, shape (rows, 4), body to reference.
        p_dot: Their first time derivatives, shape (rows, 4), [1/s].
        p_ddot: Their second time derivatives, shape (rows, 4), [1/s^2].

    Returns:
        omega [rad/s] and omega_dot [rad/s^2], shape (rows, 3) each, in the reference's axes.
    """
    inverse = p * np.array([-1.0, -1.0, -1.0, 1.0]) / np.sum(p * p, axis=1, keepdims=True)
    w = _product(p_dot, inverse)
    w_dot = _product(p_ddot, inverse) - _product(w, w)
    return 2.0 * w[:, :3], 2.0 * w_dot[:, :3]


def _product(a: Array, b: Array) -> Array:
    """Compute the quaternion product a b, shapes (rows, 4)."""
    vector = a[:, 3:] * b[:, :3] + b[:, 3:] * a[:, :3] + cross(a[:, :3], b[:, :3])
    scalar: Array = a[:, 3] * b[:, 3] - np.sum(a[:, :3] * b[:, :3], axis=1)
    return np.column_stack([vector, scalar])


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
