"""Gaussian elimination in expressions, with pivots that are chosen once at generic postures, and guards.

Pivots are chosen by their size at these postures, except nearly singular ones, and then by sparsity. At run
time the smallest pivot relative to its usual size is a measure of how far the choice can be trusted.

Guards detect samples that a compiled model hands to the general path. A guard is at most 1 where the model
can be trusted. It exceeds 1 if a pivot becomes small that is large at generic postures, or if positions or
rates leave the loops open by more than rounding. There the compiled model loses digits, and the general path
computes the sample or raises the error.

A guard is a sum of squares, each of a number over its limit. So it exceeds 1 as soon as one number exceeds
its limit, it is NaN if one number is, and it needs two operations a number and no branch.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...spatial import Array, Mask
from ...symbols import Expression, is_zero, minus, times
from .expressions import filled, zeros

#: Least pivot relative to its usual size at which the choice of pivots is trusted. Rounding errors grow with
#: the inverse square of this ratio (inertias are congruences): 5e-16 / ratio^2 was measured, so 1e-10 is
#: reached at a ratio of 2e-3. The margin is for two small pivots at once.
TRUSTED_PIVOT = 1e-2
#: Pivots smaller than the best by this factor may be chosen to keep the rows sparse.
SPARSE_PIVOT = 0.1
#: Shares of the samples at which a pivot may fail, tried in this order until some pivot is left.
FAILING = (0.0, 0.1, 0.25, 0.5)


@dataclass(frozen=True)
class Pivots:
    """Rows and columns in the order of their elimination, and the usual size of each pivot."""

    rows: tuple[int, ...]
    cols: tuple[int, ...]
    sizes: tuple[float, ...]

    def first(self, count: int) -> Pivots:
        """Return the first pivots."""
        return Pivots(self.rows[:count], self.cols[:count], self.sizes[:count])


def choose_pivots(
    samples: Array, rank: int, row_scale: Array, col_scale: Array, sparse: float = SPARSE_PIVOT
) -> Pivots:
    """Choose pivots that are large at every sample, or else at as many samples as possible.

    A sample at which not even the best remaining pivot would be trusted is nearly singular. Its remainder is
    rounding and has no information on pivots, so the sample is dropped.

    Args:
        samples: The matrix at generic postures, shape (samples, m, n); at some it may be singular or not
            finite.
        rank: Number of pivots.
        row_scale: Factor that makes each row dimensionless, shape (m,).
        col_scale: Unit of each unknown, shape (n,).
        sparse: Pivots smaller than the best by this factor may be chosen to keep the rows sparse.
    """
    A = samples[np.isfinite(samples).all(axis=(1, 2))] * row_scale[:, None] * col_scale
    structure: Mask = np.asarray((np.abs(A) > 1e-13).any(axis=0))
    left_rows, left_cols = list(range(A.shape[1])), list(range(A.shape[2]))
    rows, cols, sizes = [], [], []
    for _ in range(rank):
        block = np.abs(A[:, left_rows][:, :, left_cols])
        largest = block.max(axis=(1, 2))
        heard = largest > TRUSTED_PIVOT * np.median(largest)
        A, block, largest = A[heard], block[heard], largest[heard]
        score = _score(block / largest[:, None, None])
        pattern = structure[np.ix_(left_rows, left_cols)]
        fill = np.outer(pattern.sum(axis=1) - 1, pattern.sum(axis=0) - 1)
        good = score >= sparse * score.max()
        i, j = min(np.argwhere(good).tolist(), key=lambda ij: (fill[ij[0], ij[1]], -score[ij[0], ij[1]]))
        r, c = left_rows.pop(i), left_cols.pop(j)
        # samples at which the pivot fails are dropped
        A = A[np.abs(A[:, r, c]) >= sparse * TRUSTED_PIVOT * largest]
        pivot = A[:, r, c]
        A[:, left_rows] -= (A[:, left_rows, c] / pivot[:, None])[:, :, None] * A[:, None, r]
        structure[left_rows] |= np.outer(structure[left_rows, c], structure[r])
        rows.append(r)
        cols.append(c)
        sizes.append(float(np.median(np.abs(pivot / (row_scale[r] * col_scale[c])))))
    return Pivots(tuple(rows), tuple(cols), tuple(sizes))


def _score(size: Array) -> Array:
    """Compute the score of pivots: their size at the sample where they are smallest, shape (m, n).

    If no pivot is trusted at every sample, the worst samples of each pivot are left out.

    Args:
        size: Size of each pivot at each sample, over that of the best one there, shape (samples, m, n).
    """
    for failing in FAILING:
        score = np.sort(size, axis=0)[int(failing * (len(size) - 1))]
        if score.max() >= TRUSTED_PIVOT:
            break
    return np.asarray(score)


@dataclass(frozen=True, eq=False)
class Triangular:
    """Factors of the rows and columns with pivots, in the order of these.

    Attributes:
        upper: Upper triangular factor, shape (n, n).
        lower: Factors of the rows below each pivot, shape (n, n).
        inverses: Inverse of each pivot, shape (n,).
    """

    upper: Expression
    lower: Expression
    inverses: Expression

    @classmethod
    def of(cls, K: Expression, pivots: Pivots) -> Triangular:
        """Factor a matrix, shape (m, n), of which the pivots have rows and columns."""
        return cls.of_square(K[list(pivots.rows)][:, list(pivots.cols)])

    @classmethod
    def of_square(cls, A: Expression) -> Triangular:
        """Factor a square matrix in the order of its pivots, shape (n, n)."""
        W, n = A.copy(), len(A)
        inverses, lower = zeros(n), zeros(n, n)
        for i in range(n):
            inverses[i] = 1.0 / W[i, i]
            for j in range(i + 1, n):
                if is_zero(W[j, i]):
                    continue
                lower[j, i] = times(W[j, i], inverses[i])
                for c in range(i + 1, n):
                    if not is_zero(W[i, c]):
                        W[j, c] = minus(W[j, c], times(lower[j, i], W[i, c]))
                W[j, i] = 0.0
        return cls(W, lower, inverses)

    def part(self, at: slice) -> Triangular:
        """Return the factors of some rows and columns, one after the other."""
        return Triangular(self.upper[at, at], self.lower[at, at], self.inverses[at])

    def solve(self, right: Expression) -> Expression:
        """Solve for right-hand sides in the order of the pivots, shape (n, k)."""
        x, n = right.copy(), len(right)
        for i in range(n):
            for j in range(i + 1, n):
                take(x, j, self.lower[j, i], i)
        for i in reversed(range(n)):
            for j in range(i + 1, n):
                take(x, i, self.upper[i, j], j)
            x[i] = times(self.inverses[i : i + 1], x[i])
        return x

    def solve_transposed(self, right: Expression) -> Expression:
        """Solve the transposed equations, shape (n, k)."""
        x, n = right.copy(), len(right)
        for i in range(n):
            for j in range(i):
                take(x, i, self.upper[j, i], j)
            x[i] = times(self.inverses[i : i + 1], x[i])
        for i in reversed(range(n)):
            for j in range(i + 1, n):
                take(x, i, self.lower[j, i], j)
        return x


def take(x: Expression, row: int, factor: Any, other: int) -> None:
    """Subtract a multiple of another row in place."""
    if not is_zero(factor):
        x[row] = minus(x[row], times(filled([factor], 1), x[other]))


def solve(
    K: Expression,
    right: Expression,
    pivots: Pivots,
    free: Sequence[int] | None = None,
    factors: Triangular | None = None,
) -> tuple[Expression, Expression]:
    """Solve K x = right for the pivots' unknowns in terms of the others.

    Args:
        K: Matrix, shape (m, n); rows without a pivot are assumed to depend on the others.
        right: Right-hand sides, shape (m, k).
        pivots: The pivots.
        free: Unknowns without pivots that are wanted, by default all in order; the others are zero.
        factors: Those of K, where they are known.

    Returns:
        X: All unknowns over [right-hand sides, unknowns that are free], shape (n, k + free).
        doubts: Least trusted size of each pivot over the pivot, of either sign (`squares`).
    """
    n, k = K.shape[1], right.shape[1]
    free = [c for c in range(n) if c not in pivots.cols] if free is None else list(free)
    factors = factors or Triangular.of(K, pivots)
    X = zeros(n, k + len(free))
    X[list(pivots.cols)] = factors.solve(np.concatenate([right, -K[:, free]], axis=1)[list(pivots.rows)])
    X[free, range(k, k + len(free))] = 1.0
    doubts = [times(TRUSTED_PIVOT * size, x) for size, x in zip(pivots.sizes, factors.inverses, strict=True)]
    return X, np.array(doubts, dtype=object)
