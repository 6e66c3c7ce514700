"""The rows of closed loops at one sample, factored block by block."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.linalg import qr, solve_triangular
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ..spatial import Array, Index

if TYPE_CHECKING:
    import casadi as ca


class Singular(NamedTuple):
    """A singular value of rows, with its vectors over freedoms and over rows."""

    value: float
    freedoms: Array
    rows: Array


class RowBlock(NamedTuple):
    """Rows that share no freedom with others, at one sample: Q R = K^T with pivots, scaled.

    Attributes:
        rows, freedoms: Their numbers.
        Q, R, order: The factors and the order of rows.
        rank: Number of independent rows.
    """

    rows: Index
    freedoms: Index
    Q: Array
    R: Array
    order: Index
    rank: int

    @classmethod
    def of(cls, rows: Index, freedoms: Index, K: Array, zero: float) -> RowBlock:
        """Factor rows K^T, shape (freedoms, rows); pivots below a part `zero` of the largest are none."""
        if not len(freedoms):  # all joints stay
            return cls(rows, freedoms, K[:, :0], K, np.arange(len(rows)), 0)
        found = qr(K, pivoting=True)
        Q, R, order = np.asarray(found[0], float), np.asarray(found[1], float), np.asarray(found[2], int)
        pivots = np.abs(np.diag(R))
        rank = int(np.sum(pivots > zero * pivots[0])) if pivots.any() else 0
        return cls(rows, freedoms, Q, R, order, rank)

    @property
    def condition(self) -> float:
        """The first pivot over the last one that counts, a lower bound of the condition number."""
        return float(abs(self.R[0, 0] / self.R[self.rank - 1, self.rank - 1])) if self.rank else 1.0

    @property
    def ends(self) -> tuple[Singular, Singular]:
        """The smallest singular value that counts, and the largest."""
        U, s, Vt = np.linalg.svd(self.R, full_matrices=False)
        of_rows = np.zeros(Vt.shape)
        of_rows[:, self.order] = Vt
        least, most = (Singular(float(s[k]), self.Q @ U[:, k], of_rows[k]) for k in (self.rank - 1, 0))
        return least, most

    def solved(self, y: Array) -> tuple[Array, Array]:
        """Solve K^T x = y for independent rows; return x, and the parts of y that no row gives."""
        r, z, x = self.rank, self.Q.T @ y, np.zeros(len(self.rows))
        if r:
            x[self.order[:r]] = solve_triangular(self.R[:r, :r], z[:r])
        return x, z[r:]

    def followed(self, right: Array) -> Array:
        """Solve K y = right, by the smallest y."""
        r = self.rank
        if not r:
            return np.zeros(len(self.freedoms))
        out: Array = self.Q[:, :r] @ solve_triangular(self.R[:r, :r], right[self.order[:r]], trans="T")
        return out

    @property
    def dependent(self) -> Array:
        """Combinations of rows that vanish over all motions, shape (rows, rows - rank)."""
        r, rows = self.rank, len(self.rows)
        out = np.zeros((rows, rows - r))
        if r:
            out[self.order[:r]] = -solve_triangular(self.R[:r, :r], self.R[:r, r:])
        out[self.order[r:]] = np.eye(rows - r)
        return out


#: The blocks of rows at one sample.
Factored = list[RowBlock]


def condition_of(factors: Sequence[Factored]) -> float:
    """Return the largest condition number of rows at samples."""
    return max((block.condition for one in factors for block in one), default=1.0)


def blocks_of(K: ca.SX, free: Index) -> list[tuple[Index, Index]]:
    """Return the rows and freedoms, numbers among those that are free, of blocks that share none."""
    rows, cols = K.sparsity().get_triplet()
    n, m = K.shape[0], K.shape[1]
    kept = np.isin(cols, free)
    pairs = np.array(rows, dtype=int)[kept], n + np.array(cols, dtype=int)[kept]
    graph = coo_array((np.ones(len(pairs[0])), pairs), shape=(n + m, n + m))
    _, label = connected_components(graph, directed=False)
    own = label[n + free]
    return [(np.flatnonzero(label[:n] == k), np.flatnonzero(own == k)) for k in np.unique(label[:n])]


def reflections(n: int, m: int) -> float:
    """Return the operations of factoring K^T, (n, m), and of three right-hand sides."""
    least = min(n, m)
    factors = 2.0 * n * m * least - (n + m) * least**2 + 2.0 * least**3 / 3.0
    return factors + 3.0 * (4.0 * n * least + least**2)
