"""Reduction of closure rows to independent velocities, x_dot = Psi u: first each leg, then the platforms.

The unknowns x of a module are the joints of its legs and the relative twists of its platforms. The module's
length scales rows and columns, so that metres and radians are comparable. Ranks are determined once, at
generic postures. At samples where the pivots of a leg become small (a leg or serial singularity), the whole
module is eliminated at once with pivots chosen among all columns, which stays backward stable.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..spatial import Array, Index, Mask
from .elimination import back_substitute, null_basis, pivot_ratio, pivoted_qr, size_of_rows, surplus

#: Singular values of scaled rows below this, relative to the largest, are rounding of the file.
RANK_TOLERANCE = 1e-4
#: Least ratio of the singular values on both sides of the rank; below it the user has to set the rank.
RANK_GAP = 100.0
#: Singular values that count, but are below this and below such a gap, may be rounding of a coarse file.
SUSPECT = 1e-2
#: Relative singular values of dependent rows above this: the rows depend only up to rounding of the file.
ROUNDED_ROWS = 1e-12
#: Least pivot ratio at which a leg is eliminated separately (element growth at most 1e2).
LEG_PIVOT = 1e-2


class Basis(NamedTuple):
    """All motions that keep a module's loops closed: x_dot = Psi u, x_ddot = Psi u_dot + x_ddot_0.

    Attributes:
        Psi: Rates of leg joints and platform twists per unit u, shape (T, n, N), Eqs. (2), (15).
        drift: x_ddot_0, shape (T, n): the acceleration at u_dot = 0, Eqs. (6), (36).
        pivot: Smallest over largest pivot, shape (T,): near zero, the closures are close to losing rank.
        surplus: Largest part of a row over that of the first pivot that no pivot removes, shape (T,): above
            rounding, the closures have more than their rank.
    """

    Psi: Array
    drift: Array
    pivot: Array
    surplus: Array


@dataclass(eq=False)
class LegBlock:
    """Rows and columns of one leg.

    Attributes:
        rows: Row indices.
        cols: Column indices of the leg's own joints.
        rank: Number of pivots within the leg.
    """

    rows: Index
    cols: Index
    rank: int = 0


class RankReport(NamedTuple):
    """How the rank of a module's closures was determined.

    Attributes:
        rank: Number of independent rows.
        rows: Number of rows.
        kept: Smallest relative singular value above the tolerance (median over generic postures).
        dropped: Largest relative singular value below it, 0 if every row is independent.
        doubted: Values on both sides of a suspicious gap above the tolerance, or None.
    """

    rank: int
    rows: int
    kept: float
    dropped: float
    doubted: tuple[float, float] | None = None

    @property
    def clear(self) -> bool:
        """Whether `kept` and `dropped` differ by at least `RANK_GAP`."""
        return self.dropped * RANK_GAP <= self.kept


def decide_rank(K: Array, tolerance: float) -> RankReport:
    """Determine the generic rank of scaled rows, shape (samples, rows, columns), from singular values."""
    return decide_ranks(K[:, None], tolerance)[0]


def decide_ranks(K: Array, tolerance: float) -> list[RankReport]:
    """Determine the generic ranks of blocks of scaled rows, shape (samples, blocks, rows, columns)."""
    _, blocks, rows, _ = K.shape
    if 0 in K.shape:
        return [RankReport(0, rows, 1.0, 0.0)] * blocks
    s = np.linalg.svd(K, compute_uv=False).astype(float).swapaxes(0, 1)
    return [report_on(own / size_of_rows(own, tolerance), rows, tolerance) for own in s]


def report_on(values: Array, rows: int, tolerance: float) -> RankReport:
    """Determine the generic rank of so many rows from relative singular values, shape (samples, values)."""
    typical = _medians(values)
    rank = int(np.sum(typical > tolerance))
    kept = float(typical[rank - 1]) if rank else 1.0
    dropped = float(typical[rank]) if rank < len(typical) else 0.0
    above, below = typical[: max(rank - 1, 0)], typical[1 : max(rank, 1)]
    gaps = np.flatnonzero((above >= RANK_GAP * below) & (below < SUSPECT))
    doubted = (float(above[gaps[0]]), float(below[gaps[0]])) if len(gaps) else None
    return RankReport(rank, rows, kept, dropped, doubted)


def _medians(x: Array) -> Array:
    """Return the median of each column, shape (samples, n); `np.median` first imports masked arrays."""
    x, middle = np.sort(x, axis=0), len(x) // 2
    out: Array = x[middle] if len(x) % 2 else (x[middle - 1] + x[middle]) / 2
    return out


def _alike(blocks: list[LegBlock]) -> list[list[LegBlock]]:
    """Return groups of blocks that have as many rows, columns and pivots."""
    groups: dict[tuple[int, int, int], list[LegBlock]] = {}
    for block in blocks:
        groups.setdefault((len(block.rows), len(block.cols), block.rank), []).append(block)
    return list(groups.values())


class Reduction:
    """Block-structured elimination of one module's closures.

    Attributes:
        n: Number of unknowns.
        rank: Total number of pivots.
        mobility: n - rank, the paper's N_k.
        row_scale: Factor of each row, shape (rows,).
        col_scale: Unit of each unknown, shape (n,): x = col_scale * scaled x.
        report: How the rank was determined.
    """

    def __init__(self, row_scale: Array, col_scale: Array, blocks: list[LegBlock], shared: Index) -> None:
        self.row_scale, self.col_scale = row_scale, col_scale
        self.n = len(col_scale)
        self._blocks, self._shared = blocks, shared
        taken = np.concatenate([b.rows for b in blocks]) if blocks else np.zeros(0, dtype=int)
        alone = np.ones(len(row_scale), dtype=bool)
        alone[taken] = False
        self._shared_rows = np.flatnonzero(alone)
        self.rank = 0
        self.report = RankReport(0, len(row_scale), 1.0, 0.0)
        self._groups: list[list[LegBlock]] = []

    @property
    def mobility(self) -> int:
        """Number of independent velocities."""
        return self.n - self.rank

    @property
    def rounded(self) -> bool:
        """Whether rows are dependent only up to rounding of the file."""
        return self.report.dropped > ROUNDED_ROWS

    def scaled(self, K: Array) -> Array:
        """Return dimensionless rows, shape (T, rows, n)."""
        return K * self.row_scale[:, None] * self.col_scale

    def fix_ranks(self, K: Array, tolerance: float) -> None:
        """Determine the ranks of module and legs from rows at generic postures, shape (samples, rows, n)."""
        K = self.scaled(K)
        self.report = decide_rank(K, tolerance)
        self.rank = self.report.rank
        alone = len(self._blocks) == 1 and len(self._shared) == 0
        if alone or self.rounded:
            # One dense elimination: equivalent for a single leg, and it includes all rows of a rounded file.
            self._blocks = []
        for group in _alike(self._blocks):
            rows, cols = np.array([b.rows for b in group]), np.array([b.cols for b in group])
            reports = decide_ranks(K[:, rows[:, :, None], cols[:, None, :]], tolerance)
            for block, report in zip(group, reports, strict=True):
                block.rank = report.rank
            if not all(report.clear for report in reports):
                self._blocks = []
                break
        self._groups = _alike(self._blocks)

    def basis(self, K: Array, gamma: Array) -> Basis:
        """Compute all motions with K x_dot = 0 and K x_ddot + gamma = 0.

        Args:
            K: Closure rows, shape (T, rows, n).
            gamma: Drift term, shape (T, rows).
        """
        K, gamma = self.scaled(K), gamma * self.row_scale
        T = len(K)
        Psi, drift = np.empty((T, self.n, self.mobility)), np.empty((T, self.n))
        pivot, left = np.ones(T), np.zeros(T)
        easy = np.zeros(T, dtype=bool)
        if self._groups and self.rank:
            (Psi, drift, pivot, left), easy = self._by_legs(K, gamma)
        hard = np.flatnonzero(~easy)
        if len(hard):
            Psi[hard], drift[hard], pivot[hard], left[hard] = null_basis(K[hard], gamma[hard], self.rank)
        return Basis(Psi * self.col_scale[:, None], drift * self.col_scale, pivot, left)

    def _by_legs(self, K: Array, gamma: Array) -> tuple[Basis, Mask]:
        """Eliminate each leg, then the remaining platform rows; return the scaled basis, valid samples."""
        T, P = len(K), len(self._shared)
        right = np.concatenate([K[:, :, self._shared], gamma[..., None]], axis=-1)
        reduced, left = [], [right[:, self._shared_rows]]
        pivot, over, easy = np.ones(T), np.zeros(T), np.ones(T, dtype=bool)
        for group in self._groups:
            rows, cols = np.array([b.rows for b in group]), np.array([b.cols for b in group])
            g, m, c, r = len(group), rows.shape[1], cols.shape[1], group[0].rank
            A = np.concatenate([K[:, rows[:, :, None], cols[:, None, :]], right[:, rows]], axis=-1)
            R, order = pivoted_qr(A.reshape(T * g, m, c + P + 1), c, r)
            ratio = pivot_ratio(R, r).reshape(T, g).min(axis=1)
            easy &= ratio > LEG_PIVOT
            pivot = np.minimum(pivot, ratio)
            over = np.maximum(over, surplus(R, c, r).reshape(T, g).max(axis=1))
            left.append(R[:, r:, c:].reshape(T, g * (m - r), P + 1))
            reduced.append((cols, r, order.reshape(T, g, c), R[:, :r].reshape(T, g, r, c + P + 1)))
        platform = np.concatenate(left, axis=1)
        rank = self.rank - sum(b.rank for b in self._blocks)
        free, x0, ratio, rest = null_basis(platform[..., :-1], platform[..., -1], rank)
        Psi, drift = np.zeros((T, self.n, self.mobility)), np.zeros((T, self.n))
        Psi[:, self._shared, : P - rank], drift[:, self._shared] = free, x0
        self._back(reduced, Psi, drift, P - rank)
        basis = Basis(Psi, drift, np.minimum(pivot, ratio), np.maximum(over, rest))
        return basis, easy & (ratio > LEG_PIVOT)

    def _back(
        self, reduced: list[tuple[Index, int, Index, Array]], Psi: Array, drift: Array, first: int
    ) -> None:
        """Back-substitute the leg joints from the platforms' motion and the legs' own free joints."""
        T, P = len(Psi), len(self._shared)
        Psi_p, drift_p = Psi[:, None, self._shared, :], drift[:, None, self._shared, None]
        for cols, r, order, R in reduced:
            g, c = cols.shape
            Y = -back_substitute(
                R[..., :r].reshape(T * g, r, r), R[..., r:].reshape(T * g, r, c - r + P + 1)
            ).reshape(T, g, r, c - r + P + 1)
            own, on_platform, rest = Y[..., : c - r], Y[..., c - r : -1], Y[..., -1:]
            local = np.zeros((T, g, c, Psi.shape[2] + 1))
            local[:, :, :r, :-1] = np.matmul(on_platform, Psi_p)  # Eqs. (8), (9): J_i^-1 J_v,i a
            local[:, :, :r, -1:] = np.matmul(on_platform, drift_p) + rest  # Eqs. (10), (11)
            for i in range(g):
                free = slice(first + i * (c - r), first + (i + 1) * (c - r))
                local[:, i, :r, free] = own[:, i]
                local[:, i, r:, free] = np.eye(c - r)
            first += g * (c - r)
            out = np.empty_like(local)
            np.put_along_axis(out, order[..., None], local, axis=2)
            Psi[:, cols], drift[:, cols] = out[..., :-1], out[..., -1]
