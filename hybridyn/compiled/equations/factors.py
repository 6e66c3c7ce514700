"""Factors of symmetric matrices in expressions, what they solve, and numbers handed on.

A kernel hands the numbers of its arrays that are not known to a later kernel, which builds the arrays anew.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce
from typing import Any

import casadi as ca
import numpy as np

from ...spatial import Array
from ...symbols import Expression, dot, is_zero, minus, times
from .expressions import along, eye, pack, symbols, zeros
from .guarded_elimination import Pivots, Triangular, solve, take


@dataclass(frozen=True, eq=False)
class Definite:
    """Factors L D L^T of a symmetric positive definite matrix.

    Attributes:
        lower: L without its unit diagonal, shape (n, n).
        inverses: Inverse of each entry of D, shape (n,).
    """

    lower: Expression
    inverses: Expression

    @classmethod
    def of(cls, A: Expression) -> tuple[Definite, Expression]:
        """Factor a matrix, shape (n, n); return the factors, and the entries of D, its pivots."""
        W, n = A.copy(), len(A)
        lower, inverses = zeros(n, n), zeros(n)
        for i in range(n):
            inverses[i] = 0.0 if is_zero(W[i, i]) else 1.0 / W[i, i]
            for j in range(i + 1, n):
                if is_zero(W[j, i]):
                    continue
                lower[j, i] = times(W[j, i], inverses[i])
                for c in range(i + 1, j + 1):
                    W[j, c] = minus(W[j, c], times(lower[j, i], W[c, i]))
        return cls(lower, inverses), np.diag(W)

    @classmethod
    def certain(cls, A: Expression, least: float) -> tuple[Definite, Any]:
        """Factor a matrix, shape (n, n).

        Args:
            A: The matrix.
            least: Least trusted ratio of a pivot to its diagonal entry.

        Returns:
            The factors, and a guard: above 1 where a pivot is smaller.
        """
        factors, pivots = cls.of(A)
        each = zip(pivots, np.diag(A), strict=True)
        small = (ca.if_else(pivot > least * entry, 0.0, 2.0) for pivot, entry in each)
        return factors, reduce(ca.fmax, small, ca.SX(0.0))

    def halfway(self, right: Expression) -> Expression:
        """Compute L^-1 right, shape (n, k)."""
        x = right.copy()
        for i in range(len(x)):
            for j in range(i + 1, len(x)):
                take(x, j, self.lower[j, i], i)
        return x

    def solve(self, right: Expression) -> Expression:
        """Solve for right-hand sides, shape (n, k)."""
        x = self.halfway(right)
        for i in reversed(range(len(x))):
            x[i] = times(self.inverses[i : i + 1], x[i])
            for j in range(i + 1, len(x)):
                take(x, i, self.lower[j, i], j)
        return x

    def lengths(self, right: Expression) -> Expression:
        """Compute the root of x^T A^-1 x of each column x, shape (k,)."""
        out = zeros(right.shape[1])
        for k, x in enumerate(self.halfway(right).T):
            if not all(map(is_zero, x)):
                out[k] = ca.sqrt(sum(times(d, times(y, y)) for d, y in zip(self.inverses, x, strict=True)))
        return out

    def weighed(self, right: Expression) -> Expression:
        """Compute right^T A^-1 right, of which only the lower triangle is meant, shape (k, k)."""
        half = self.halfway(right)
        scaled = half.copy()
        for i, d in enumerate(self.inverses):
            scaled[i] = [times(d, y) for y in half[i]]
        out = zeros(half.shape[1], half.shape[1])
        for i in range(len(out)):
            for j in range(i + 1):
                out[i, j] = out[j, i] = along(half[:, i], scaled[:, j])
        return out

    def trace(self, B: Expression) -> Any:
        """Compute the trace of A^-1 B, B symmetric."""
        X = self.solve(B)
        return sum((X[i, i] for i in range(len(X))), ca.SX(0.0))

    def root(self, right: Expression) -> Expression:
        """Compute D^-1/2 L^-1 right: its product with its transpose is `weighed`."""
        half = self.halfway(right)
        rows = [[times(ca.sqrt(d), y) for y in row] for d, row in zip(self.inverses, half, strict=True)]
        return np.array(rows, dtype=object).reshape(half.shape)


def solve_definite(A: Expression, right: Expression, noise: float) -> tuple[Expression, ca.SX]:
    """Solve A X = right for a symmetric positive definite A, as `factored` tells, shape (n, k)."""
    factors, trust = factored(A, noise)
    return factors.solve(right), trust


def factored(A: Expression, noise: float, least: Expression | None = None) -> tuple[Definite, ca.SX]:
    """Factor a symmetric positive definite A, shape (n, n), by L D L^T.

    Args:
        A: The matrix.
        noise: Least trusted ratio of a pivot to its diagonal entry of A.
        least: Least trusted pivots, shape (n,), where the entries of A may be rounding.

    Returns:
        The factors, and the smallest ratio of a pivot to the least trusted one.
    """
    (factors, pivots), trust = Definite.of(A), ca.SX(np.inf)
    for i, pivot in enumerate(pivots):
        bound = noise * A[i, i] if least is None else ca.fmax(noise * A[i, i], least[i])
        # if it is 0: fmin would ignore the NaN of 0 / 0
        trust = ca.fmin(trust, 0.0 if is_zero(pivot) else ca.if_else(bound > 0, pivot / bound, 0.0))
    return factors, trust


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
    C = Triangular.of_square(scaled[rows][:, cols].T).solve(scaled[left][:, cols].T).T
    r = dot(scaled[left], X)
    r[:, : right.shape[1]] = r[:, : right.shape[1]] - right[left] * weight[left, None]
    y, _ = solve_definite(eye(len(left)) + dot(C, C.T), r, 1.0)
    X[cols] = X[cols] - Triangular.of_square(scaled[rows][:, cols]).solve(dot(C.T, y))
    return X, doubts


class Handed:
    """Arrays of which a kernel hands on the numbers that are not known when it is written."""

    def __init__(self, **arrays: Expression) -> None:
        """Take the arrays by name."""
        self._arrays = arrays
        self.size = sum(_unknown(x) for array in arrays.values() for x in array.ravel())

    def pack(self) -> ca.SX:
        """Return the numbers as a column."""
        return pack([x for array in self._arrays.values() for x in array.ravel() if _unknown(x)])

    def again(self, name: str) -> tuple[ca.SX, dict[str, Expression]]:
        """Return a column of symbols for the numbers, and the arrays with these."""
        column, entries = symbols(name, self.size)
        rest, out = iter(entries), {}
        for key, array in self._arrays.items():
            flat = [next(rest) if _unknown(x) else float(x) for x in array.ravel()]
            out[key] = np.array([*flat, None], dtype=object)[:-1].reshape(array.shape)
        return column, out


def _unknown(x: Any) -> bool:
    """Return whether a scalar is no number."""
    return isinstance(x, ca.SX) and not x.is_constant()
