"""Compute the rates that a table leaves out, from an interpolating quintic spline over time.

Rows are read in blocks, so that no spline can go through all of them at once. This is not needed either: the
influence of a row decays by a factor of about 0.43 per row (uniform steps), so that a window with `HALO` rows
on either side gives the same numbers as the whole table.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..description.records import Array
from ..spatial import cross
from .opening import Block
from .spline import DEGREE, Spline

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
    for block in blocks:
        rows = np.concatenate([rows, block.values]) if len(rows) else block.values
        waiting.append((block.first_row, block.first_row + len(block.values)))
        while waiting and start + len(rows) >= waiting[0][1] + halo:
            first, stop = waiting.pop(0)
            yield _window(rows, start, first, stop, halo)
            unused = max(0, stop - halo - start)
            rows, start = rows[unused:], start + unused
    for first, stop in waiting:
        yield _window(rows, start, first, stop, halo)


def _window(rows: Array, start: int, first: int, stop: int, halo: int) -> Window:
    low = max(first - halo - start, 0)
    return Window(first, rows[low : stop + halo - start], slice(first - start - low, stop - start - low))


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
    scalar: NDArray[np.float64] = a[:, 3] * b[:, 3] - np.sum(a[:, :3] * b[:, :3], axis=1)
    return np.column_stack([vector, scalar])
