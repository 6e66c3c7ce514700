"""Factors of matrices in expressions, for several solutions by one elimination, and numbers handed on.

A kernel hands the numbers of its arrays that are not known to a later kernel, which builds the arrays anew.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from ...symbols import Expression, is_zero, minus, times
from .expressions import along, pack, symbols, zeros
from .guarded_elimination import take


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
    def of(cls, A: Expression, least: float) -> tuple[Definite, Any]:
        """Factor a matrix, shape (n, n).

        Args:
            A: The matrix.
            least: Least trusted ratio of a pivot to its diagonal entry.

        Returns:
            The factors, and a guard: above 1 where a pivot is smaller.
        """
        W, n = A.copy(), len(A)
        lower, inverses, guard = zeros(n, n), zeros(n), ca.SX(0.0)
        for i in range(n):
            guard = ca.fmax(guard, ca.if_else(W[i, i] > least * A[i, i], 0.0, 2.0))
            inverses[i] = 1.0 / W[i, i]
            for j in range(i + 1, n):
                if is_zero(W[j, i]):
                    continue
                lower[j, i] = times(W[j, i], inverses[i])
                for c in range(i + 1, j + 1):
                    W[j, c] = minus(W[j, c], times(lower[j, i], W[c, i]))
        return cls(lower, inverses), guard

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
            x[i] = [times(self.inverses[i], y) for y in x[i]]
            for j in range(i + 1, len(x)):
                take(x, i, self.lower[j, i], j)
        return x

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
