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
from itertools import takewhile
from typing import Any

import casadi as ca
import numpy as np

from ...spatial import Array, Mask
from ...symbols import Expression, dot, is_zero, minus, plus, times
from .expressions import along, eye, pack, zeros

#: Least pivot relative to its usual size at which the choice of pivots is trusted. Rounding errors grow with
#: the inverse square of this ratio (inertias are congruences): 5e-16 / ratio^2 was measured, so 1e-10 is
#: reached at a ratio of 2e-3. The margin is for two small pivots at once.
TRUSTED_PIVOT = 1e-2
#: Pivots smaller than the best by this factor may be chosen to keep the rows sparse.
SPARSE_PIVOT = 0.1
#: Operations that bounds by the inverse of a block may take beyond those by triangular factors, as a part of
#: these. Bounds of the turning of shipped robots are up to 14 times lower by it.
INVERTED = 0.1
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


def solve(
    K: Expression, right: Expression, pivots: Pivots, free: Sequence[int] | None = None
) -> tuple[Expression, Expression]:
    """Solve K x = right for the pivots' unknowns in terms of the others.

    Args:
        K: Matrix, shape (m, n); rows without a pivot are assumed to depend on the others.
        right: Right-hand sides, shape (m, k).
        pivots: The pivots.
        free: Unknowns without pivots that are wanted, by default all in order; the others are zero.

    Returns:
        X: All unknowns over [right-hand sides, unknowns that are free], shape (n, k + free).
        doubts: Least trusted size of each pivot over the pivot, of either sign (`squares`).
    """
    n, k = K.shape[1], right.shape[1]
    free = [c for c in range(n) if c not in pivots.cols] if free is None else list(free)
    W = np.concatenate([K[:, list(pivots.cols)], right, -K[:, free]], axis=1)[list(pivots.rows)]
    inverses, _ = eliminate(W)
    doubts = [times(TRUSTED_PIVOT * size, x) for size, x in zip(pivots.sizes, inverses, strict=True)]
    X = zeros(n, k + len(free))
    X[list(pivots.cols)] = _substitute(W, inverses)
    X[free, range(k, k + len(free))] = 1.0
    return X, np.array(doubts, dtype=object)


def balanced(
    K: Expression, right: Expression, pivots: Pivots, weight: Array
) -> tuple[Expression, Expression]:
    """Solve as `solve`, but let rows without a pivot count like the others, in the least-squares sense.

    Such rows C K_p + d depend on those with pivots up to the rounding d of a file. The solution of the rows
    with pivots leaves them open by r, and changing it by x with K_p x = z balances all rows:

        z = -C^T (1 + C C^T)^-1 r

    The neglected terms are of second order in d, as are those of the general path, which takes the same rows
    by orthogonal steps. The condition of the small matrix matters only for a change of the size of d.

    Args:
        K, right, pivots: As for `solve`; every row counts.
        weight: Factor that makes each row dimensionless, shape (m,).
    """
    X, doubts = solve(K, right, pivots)
    rows, cols = list(pivots.rows), list(pivots.cols)
    left = [i for i in range(len(K)) if i not in rows]
    if not left:
        return X, doubts
    scaled = K * weight[:, None]
    C = _solved(scaled[rows][:, cols].T, scaled[left][:, cols].T).T
    r = dot(scaled[left], X)
    r[:, : right.shape[1]] = r[:, : right.shape[1]] - right[left] * weight[left, None]
    y, _ = solve_definite(eye(len(left)) + dot(C, C.T), r, 1.0)
    X[cols] = X[cols] - _solved(scaled[rows][:, cols], dot(C.T, y))
    return X, doubts


def _solved(A: Expression, right: Expression) -> Expression:
    """Solve A X = right for a square A in the order of its pivots, shape (n, k)."""
    W = np.concatenate([A, right], axis=1)
    inverses, _ = eliminate(W)
    return _substitute(W, inverses)


def eliminate(W: Expression) -> tuple[list[Any], Expression]:
    """Make W upper triangular in place; return the inverses of its pivots, and the factors of its rows.

    Args:
        W: Square matrix in the order of its pivots, then right-hand sides, shape (n, n + k).
    """
    rank = len(W)
    inverses, factors = [], zeros(rank, rank)
    for i in range(rank):
        inverses.append(1.0 / W[i, i])
        for j in range(i + 1, rank):
            if is_zero(W[j, i]):
                continue
            factors[j, i] = factor = times(W[j, i], inverses[i])
            for c in range(i + 1, W.shape[1]):
                if not is_zero(W[i, c]):
                    W[j, c] = minus(W[j, c], times(factor, W[i, c]))
            W[j, i] = 0.0
    return inverses, factors


def _substitute(W: Expression, inverses: list[Any]) -> Expression:
    """Solve what `eliminate` leaves, shape (n, k)."""
    rank = len(W)
    solved = zeros(rank, W.shape[1] - rank)
    for i in reversed(range(rank)):
        rest = W[i, rank:] - dot(W[i, i + 1 : rank], solved[i + 1 :]) if i + 1 < rank else W[i, rank:]
        solved[i] = [times(inverses[i], x) for x in rest]
    return solved


def largest_solutions(K: Expression, size: Expression, pivots: Pivots) -> Expression:
    """Bound the unknowns of K x = y for every y with abs(y) <= size.

    The last unknowns are bounded by the absolute inverse of their block, as many as `INVERTED` lets. The
    others are bounded by the absolute triangular factors, which takes fewer operations and loses little for
    sparse rows.

    Args:
        K: Matrix, shape (m, n).
        size: Bounds of the right-hand side, shape (m,).

    Returns:
        Bounds of abs(x), shape (n,); zero for unknowns without a pivot.
    """
    rows, cols = list(pivots.rows), list(pivots.cols)
    W = K[rows][:, cols]
    inverses, factors = eliminate(W)
    tries = (_bounded(W, factors, inverses, size[rows], first) for first in reversed(range(len(W) + 1)))
    by_factors, bounds = next(tries), zeros(K.shape[1])
    most = (1.0 + INVERTED) * ca.n_nodes(pack(by_factors))
    bounds[cols] = [by_factors, *takewhile(lambda x: ca.n_nodes(pack(x)) <= most, tries)][-1]
    return bounds


def _bounded(
    W: Expression, factors: Expression, inverses: list[Any], size: Expression, first: int
) -> Expression:
    """Bound unknowns by the inverse of the block from the first row on, and before it by factors, shape (n,).

    Args:
        W, factors, inverses: What `eliminate` leaves, and returns.
        size: Bounds of the right-hand side in the order of the pivots, shape (n,).
        first: First row of the block.
    """
    rank, reach = len(W), size.copy()
    for i in range(first):
        for j in range(i + 1, rank):
            reach[j] = plus(reach[j], times(ca.fabs(factors[j, i]), reach[i]))
    block = np.concatenate([W[first:, first:] + factors[first:, first:], eye(rank - first)], axis=1)
    for i in range(rank - first):  # the columns of the inverse, by the factors that are known
        for j in range(i + 1, rank - first):
            for c in range(rank - first, rank - first + i + 1):
                block[j, c] = minus(block[j, c], times(block[j, i], block[i, c]))
    inverse = _substitute(block, inverses[first:])
    out = zeros(rank)
    for i in range(first, rank):
        out[i] = along(np.array([ca.fabs(x) for x in inverse[i - first]], dtype=object), reach[first:])
    for i in reversed(range(first)):
        known = [times(ca.fabs(W[i, c]), out[c]) for c in range(i + 1, rank)]
        out[i] = times(ca.fabs(inverses[i]), sum(known, reach[i]))
    return out


def solve_definite(
    A: Expression, right: Expression, noise: float, least: Expression | None = None
) -> tuple[Expression, ca.SX]:
    """Solve A X = right for a symmetric positive definite A by L D L^T.

    Args:
        A: Shape (n, n).
        right: Shape (n, k).
        noise: Least trusted ratio of a pivot to its diagonal entry of A.
        least: Least trusted pivots, shape (n,), where the entries of A may be rounding.

    Returns:
        X, shape (n, k), and the smallest ratio of a pivot to the least trusted one.
    """
    n = len(A)
    L, inverse, trust = zeros(n, n), [], ca.SX(np.inf)
    W, B = A.copy(), right.copy()
    for i in range(n):
        nothing = is_zero(W[i, i])
        bound = noise * A[i, i] if least is None else ca.fmax(noise * A[i, i], least[i])
        # if it is 0: fmin would ignore the NaN of 0 / 0
        trust = ca.fmin(trust, 0.0 if nothing else ca.if_else(bound > 0, W[i, i] / bound, 0.0))
        inverse.append(0.0 if nothing else 1.0 / W[i, i])
        for j in range(i + 1, n):
            if is_zero(W[j, i]):
                continue
            L[j, i] = W[j, i] * inverse[i]
            for c in range(i + 1, j + 1):
                W[j, c] = minus(W[j, c], times(L[j, i], W[c, i]))
            for c in range(B.shape[1]):
                B[j, c] = minus(B[j, c], times(L[j, i], B[i, c]))
    X = zeros(*right.shape)
    for i in reversed(range(n)):
        for c in range(B.shape[1]):
            tail = along(L[i + 1 :, i], X[i + 1 :, c]) if i + 1 < n else 0.0
            X[i, c] = times(inverse[i], B[i, c]) - tail
    return X, trust
