"""Householder's factors of tall matrices in expressions, from which least solutions follow."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca

from ...symbols import Expression, times
from .expressions import along, zeros


@dataclass(frozen=True, eq=False)
class Reflected:
    """Factors A = Q [R; 0] of a matrix, shape (m, n), m not less than n.

    Attributes:
        R: Upper triangular factor, shape (n, n).
        reflections: A vector h and a factor c for each column; Q is the product of all I - c h h^T, each of
            which acts on the last entries.
        rows: m.
    """

    R: Expression
    reflections: list[tuple[Expression, Any]]
    rows: int

    @classmethod
    def of(cls, matrix: Expression) -> Reflected:
        """Factor a matrix of full rank, shape (m, n)."""
        A, (m, n) = matrix.copy(), matrix.shape
        reflections, R = list[tuple[Expression, Any]](), zeros(n, n)
        for k in range(n):
            norm = ca.sqrt(ca.SX(along(A[k:, k], A[k:, k])))  # of plain numbers, too, where A is constant
            signed = ca.if_else(A[k, k] < 0, norm, -norm)
            h = A[k:, k].copy()
            h[0] = h[0] - signed
            reflections.append((h, -1.0 / (signed * h[0])))  # 2 / h'h, h'h = -2 signed h_0
            R[k, k] = signed
            for j in range(k + 1, n):
                A[k:, j] = _reflected(reflections[k], A[k:, j])
                R[k, j] = A[k, j]
        return cls(R, reflections, m)

    def least(self, b: Expression) -> Expression:
        """Compute the least y with A^T y = b, shape (m,)."""
        y, n = zeros(self.rows), len(self.R)
        for i in range(n):
            y[i] = (b[i] - (along(self.R[:i, i], y[:i]) if i else 0.0)) / self.R[i, i]
        return self._turned(y)

    def unseen(self) -> Expression:
        """Compute an orthonormal basis of the y with A^T y = 0, shape (m, m - n)."""
        out = zeros(self.rows, self.rows - len(self.R))
        for k in range(out.shape[1]):
            out[len(self.R) + k, k] = 1.0
            out[:, k] = self._turned(out[:, k])
        return out

    def _turned(self, y: Expression) -> Expression:
        """Compute Q y."""
        out = y.copy()
        for k in reversed(range(len(self.R))):
            out[k:] = _reflected(self.reflections[k], out[k:])
        return out


def _reflected(reflection: tuple[Expression, Any], y: Expression) -> Expression:
    """Compute y - c h h^T y."""
    h, c = reflection
    factor = times(c, along(h, y))
    out: Expression = y - [times(factor, x) for x in h]
    return out
