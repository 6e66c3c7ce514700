"""Solve A_t x = b with the articulated inertia A_t of a module, symmetric and positive semidefinite.

The Cholesky factorization with diagonal pivoting is accurate for graded matrices (light legs under a heavy
platform). A pivot that does not exceed the rounding of its terms belongs to a motion without inertia.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..linkage.elimination import back_substitute
from ..spatial import Array, Index

EPS = float(np.finfo(float).eps)


def congruence(B: Array, M: Array) -> Array:
    """Compute B^T M B for B of shape (T, n, N) and M of shape (T, n, n)."""
    out: Array = np.matmul(np.swapaxes(B, 1, 2), np.matmul(M, B))
    return out


@dataclass(frozen=True, eq=False)
class InertiaFactor:
    """A pivoted Cholesky factor P^T A P = R^T R of many matrices.

    Attributes:
        R: Upper triangular factors, shape (T, N, N); rows of dropped pivots are zero.
        order: Pivot order, shape (T, N).
        massless: Number of dropped pivots (the last ones), shape (T,).
    """

    R: Array
    order: Index
    massless: Index

    def solve(self, b: Array) -> tuple[Array, Array]:
        """Solve A x = b for b of shape (T, N, c), with x = 0 for the dropped pivots.

        Returns:
            x, and the part of b that acts on massless motions, both of shape (T, N, c).
        """
        y = np.take_along_axis(b, self.order[:, :, None], axis=1)
        for i in range(b.shape[1]):
            pivot = self.R[:, i, i]
            kept = pivot > 0
            row = np.where(kept[:, None], y[:, i] / np.where(kept, pivot, 1.0)[:, None], 0.0)
            y[:, i + 1 :] -= self.R[:, i, i + 1 :, None] * row[:, None]
            y[:, i] = np.where(kept[:, None], row, y[:, i])
        dropped = (np.diagonal(self.R, axis1=1, axis2=2) == 0)[:, :, None]
        left, x = np.zeros_like(b), np.empty_like(b)
        np.put_along_axis(left, self.order[:, :, None], np.where(dropped, y, 0.0), axis=1)
        solved = back_substitute(self.R, np.where(dropped, 0.0, y))
        np.put_along_axis(x, self.order[:, :, None], solved, axis=1)
        return x, left

    def null_space(self, sample: int) -> Array:
        """Compute a basis of the massless motions of one sample, shape (N, massless)."""
        N, k = self.R.shape[1], int(self.massless[sample])
        r = N - k
        null = np.zeros((N, k))
        upper = -back_substitute(self.R[sample : sample + 1, :r, :r], self.R[sample : sample + 1, :r, r:])[0]
        null[self.order[sample]] = np.vstack([upper, np.eye(k)])
        return null


def factor_inertia(A: Array, noise: Array) -> InertiaFactor:
    """Factor inertia matrices with diagonal pivoting.

    Args:
        A: Symmetric positive semidefinite matrices, shape (T, N, N), all entries in [kg m^2].
        noise: Rounding of each diagonal entry, shape (T, N); pivots at or below it are dropped.
    """
    T, N, _ = A.shape
    A, noise = A.copy(), noise.copy()
    R = np.zeros_like(A)
    order = np.tile(np.arange(N), (T, 1))
    batch = np.arange(T)
    massless = np.zeros(T, dtype=int)
    for k in range(N):
        diagonal = np.diagonal(A, axis1=1, axis2=2)[:, k:]
        excess = np.where(diagonal > noise[:, k:], diagonal, -1.0)
        best = k + np.argmax(excess, axis=1)
        for x in (order, noise):
            x[batch, k], x[batch, best] = x[batch, best], x[batch, k].copy()
        for x in (A, R):
            x[batch, :, k], x[batch, :, best] = x[batch, :, best], x[batch, :, k].copy()
        A[batch, k], A[batch, best] = A[batch, best], A[batch, k].copy()
        kept = A[:, k, k] > noise[:, k]
        massless += ~kept
        root = np.sqrt(np.where(kept, A[:, k, k], 1.0))
        R[:, k, k:] = np.where(kept[:, None], A[:, k, k:] / root[:, None], 0.0)
        A[:, k + 1 :, k + 1 :] -= R[:, k, k + 1 :, None] * R[:, k, None, k + 1 :]
    return InertiaFactor(R, order, massless)
