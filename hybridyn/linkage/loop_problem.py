"""Closures and targets of one module as rows to be made zero by Newton's method.

If the free freedoms split into blocks of full column rank (the legs under a prescribed platform), QR solves
each block separately; else a step is the least-norm one by singular values.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..spatial import Array, Index, Mask
from .closures import Closures
from .elimination import full_rank_solution, least_squares, relative_change
from .motion import Motion
from .reduction import RANK_TOLERANCE, LegBlock
from .targets import Target
from .tree import Tree


@dataclass(frozen=True, eq=False)
class LoopProblem:
    """Rows to be made zero over some freedoms of a tree.

    Attributes:
        closures: Closures and their tree.
        row_scale: Factor of each closure row, shape (rows,).
        col_scale: Unit of each freedom, shape (nv,).
        free: Mask of the freedoms that may move, shape (nv,).
        targets: Prescribed poses of bodies; each adds rows.
        rank: Number of singular values used; if None, those above `rank_tolerance`.
        blocks: Blocks of full column rank that cover all free freedoms; empty for one dense step.
        rank_tolerance: Relative singular value from which on rows count as independent.
    """

    closures: Closures
    row_scale: Array
    col_scale: Array
    free: Mask
    targets: Sequence[Target] = ()
    rank: int | None = None
    blocks: Sequence[LegBlock] = ()
    rank_tolerance: float = RANK_TOLERANCE

    @property
    def tree(self) -> Tree:
        """The tree."""
        return self.closures.tree

    @property
    def has_loops(self) -> bool:
        """Whether there are closures."""
        return bool(self.closures.rows)

    def residual(self, q: Array, samples: Index, motion: Motion | None = None) -> Array:
        """Compute the scaled residuals, shape (T, rows).

        Args:
            q: Positions, shape (T, nq).
            samples: Index of each row of q into the targets' samples, shape (T,).
            motion: The sweep at q, computed if None.
        """
        motion = motion or self.tree.sweep(q)
        rows = [t.residual(motion, samples) / t.units for t in self.targets]
        loops = self.closures.residual(q, motion)
        return np.concatenate([loops * self.row_scale, *rows], axis=1)

    @cached_property
    def moving(self) -> Closures:
        """The closures restricted to the free freedoms."""
        return self.closures.moved_by(self.free)

    def matrix(self, motion: Motion, samples: Index | None = None, *, every: bool = True) -> Array:
        """Compute the scaled rows, shape (T, rows, nv), over all freedoms, or at least the free ones.

        Args:
            motion: Motion of the tree.
            samples: Index of each of its samples into the targets'; None at postures of no sample.
            every: Whether over all freedoms.
        """
        closures = self.closures if every else self.moving
        K = closures.matrix(motion, (self.row_scale, self.col_scale))
        if not self.targets:
            return K
        rows = [
            t.matrix(self.tree, motion, samples) / t.units[:, None] * self.col_scale for t in self.targets
        ]
        return np.concatenate([K, *rows], axis=1)

    def solve(self, K: Array, rhs: Array, damping: Array | None = None) -> Array:
        """Solve K x = rhs for the free freedoms, least norm, scaled, shape (T, nv); the others are zero."""
        out = np.zeros((len(K), self.tree.nv))
        if self.blocks and (damping is None or not damping.any()):
            hard = self._solve_blocks(K, rhs, out)
        else:
            hard = np.arange(len(K))
        if len(hard):
            A = K[hard][:, :, self.free]
            damped = np.zeros(len(hard)) if damping is None else damping[hard]
            out[np.ix_(hard, self.free)] = least_squares(
                A, rhs[hard], relative=self.rank_tolerance, rank=self.rank, damping=damped
            )
        return out

    def turned(self, q: Array, samples: Index) -> Array:
        """Compute the relative change of the rows from samples to the next ones, as `change`, shape (T,).

        Args:
            q: Positions at all samples, shape (all, nq).
            samples: Their indices, shape (T,).
        """
        both = np.concatenate([samples, samples + 1])
        K = self.matrix(self.tree.sweep(q[both]), both, every=False)
        return self.change(K[: len(samples)], K[len(samples) :])

    def change(self, before: Array, after: Array) -> Array:
        """Compute the relative change |J^-1 (J' - J)| of the rows over the free freedoms, shape (T,).

        Args:
            before: J, scaled rows over all freedoms, shape (T, rows, nv).
            after: J', scaled rows at the other posture, shape (T, rows, nv).
        """
        if not self.blocks:
            J, J_after = (x[:, :, self.free] for x in (before, after))
            return relative_change(J, J_after - J, J.shape[2] if self.rank is None else self.rank)
        out = np.zeros(len(before))
        for rows, cols in self._blocks_by_shape:
            at = rows[:, :, None], cols[:, None, :]
            J, J_after = (x[:, *at].reshape(-1, rows.shape[1], cols.shape[1]) for x in (before, after))
            change = relative_change(J, J_after - J, cols.shape[1]).reshape(len(before), -1)
            out = np.maximum(out, change.max(axis=1))
        return out

    @cached_property
    def _blocks_by_shape(self) -> list[tuple[Index, Index]]:
        """Rows and columns of the blocks, shapes (blocks, m) and (blocks, c), for each m and c."""
        shapes: dict[tuple[int, int], list[LegBlock]] = {}
        for block in self.blocks:
            shapes.setdefault((len(block.rows), len(block.cols)), []).append(block)
        groups = shapes.values()
        return [(np.array([b.rows for b in group]), np.array([b.cols for b in group])) for group in groups]

    def _solve_blocks(self, K: Array, rhs: Array, out: Array) -> Index:
        """Solve block by block into `out`; return the samples at which a block is close to singular."""
        T = len(K)
        easy = np.ones(T, dtype=bool)
        for rows, cols in self._blocks_by_shape:
            (count, m), c = rows.shape, cols.shape[1]
            A, b = K[:, rows[:, :, None], cols[:, None, :]], rhs[:, rows]
            x, sure = full_rank_solution(A.reshape(-1, m, c), b.reshape(-1, m), RANK_TOLERANCE)
            out[:, cols] = x.reshape(T, count, c)
            easy &= sure.reshape(T, count).all(axis=1)
        return np.flatnonzero(~easy)
