"""Newton's method on the closures and targets of one module, for a batch of starts.

Each step is the least-norm Gauss-Newton step, truncated to the generic rank of the rows. Its length is
limited (a trust region in scaled coordinates), and it is damped while the residual does not decrease. If the
free freedoms split into blocks of full column rank (the legs under a prescribed platform), QR solves each
block separately.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple, Protocol

import numpy as np

from ..spatial import Array, Index, Mask
from .closures import Closures
from .elimination import full_rank_solution, least_squares, relative_change
from .motion import Motion
from .reduction import RANK_TOLERANCE, LegBlock
from .targets import Target
from .tree import Tree

#: Longest step of one iteration in scaled coordinates [rad, module lengths].
LONGEST_STEP = 0.5
#: Residuals below this are rounding: damped steps may converge there at a singular posture, and a step longer
#: than `NEVER_DAMPED` is rounding over a lost singular value, so that it is not taken.
RESIDUAL_ROUNDING = 1e-12
#: Newton has converged after a step below this: quadratic convergence makes the next one its square.
SMALLEST_STEP = 1e-9
#: A step below this is taken also where it opens the rows.
NEVER_DAMPED = 1e-6
#: An open start stalls (near a minimum, or creeping) if `PATIENCE` iterations leave more than this part of
#: its residual; it has settled at a minimum if they leave more than the second part.
STALLED, SETTLED, PATIENCE = 0.8, 1 - 1e-9, 8


class Closed(NamedTuple):
    """Result of Newton's method for each start.

    Attributes:
        q: Positions, shape (T, nq).
        residual: Largest scaled residual over the rows, shape (T,).
        step: Length of the next step, shape (T,): zero where the residual is orthogonal to the rows' range.
        iterations: Number of iterations.
    """

    q: Array
    residual: Array
    step: Array
    iterations: int


class Problem(Protocol):
    """Rows to be made zero over the freedoms of a tree, as those of `LoopProblem`."""

    @property
    def tree(self) -> Any:
        """What integrates displacements, and sweeps through bodies."""

    @property
    def col_scale(self) -> Array:
        """Unit of each freedom, shape (nv,)."""

    def residual(self, q: Array, samples: Index, motion: Any = None) -> Array:
        """Compute the scaled residuals, shape (T, rows)."""

    def matrix(self, motion: Any, samples: Index | None = None, *, every: bool = True) -> Any:
        """Compute the scaled rows."""

    def solve(self, K: Any, rhs: Array, damping: Array | None = None) -> Array:
        """Solve the rows for the free freedoms, least norm, scaled, shape (T, nv)."""


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


def newton_step(problem: Problem, K: Any, residual: Array, damping: Array | None = None) -> Array:
    """Compute the step that makes a problem's rows zero, scaled, shape (T, nv).

    A long step that residuals of rounding ask for is rounding over a lost singular value: none is taken.

    Args:
        K: The scaled rows at the postures.
        residual: Their scaled residuals, shape (T, rows).
        damping: As `Problem.solve` takes it.
    """
    dx = problem.solve(K, -residual, damping)
    closed = np.abs(residual).max(axis=1, initial=0.0) <= RESIDUAL_ROUNDING
    if closed.any():
        dx[closed & (np.abs(dx).max(axis=1, initial=0.0) > NEVER_DAMPED)] = 0.0
    return dx


def close(
    problem: Problem,
    q: Array,
    samples: Index | None = None,
    *,
    iterations: int = 60,
    least: bool = False,
    enough: float = np.inf,
) -> Closed:
    """Make a problem's rows zero by Newton's method from given starts.

    Args:
        problem: Rows and the freedoms that may move.
        q: Starts, shape (T, nq).
        samples: Index of each start into the targets' samples, shape (T,); 0 by default.
        iterations: Maximum number of iterations.
        least: Whether to accept a minimum of the residual, closed or not, at which damped steps converge. If
            False, only undamped steps count as converged: a target just out of reach has such a minimum at
            the boundary of the workspace.
        enough: Open starts of which `PATIENCE` iterations leave more than this part of the residual are
            dropped: `STALLED`, `SETTLED` or none.
    """
    tree, q, T = problem.tree, q.copy(), len(q)
    samples = np.zeros(T, dtype=int) if samples is None else samples
    motion = tree.sweep(q)
    residual = problem.residual(q, samples, motion)
    damping, last = np.zeros(T), np.full(T, np.inf)
    active, size = np.arange(T), np.linalg.norm(residual, axis=1)
    spent = 0
    course = [size]
    for spent in range(1, iterations + 1):  # noqa: B007 - the count is reported
        K = problem.matrix(motion, samples[active], every=False)
        dx = newton_step(problem, K, residual[active], damping[active])
        open_by = np.abs(residual[active]).max(axis=1, initial=0.0)
        final = least | (damping[active] == 0.0) | (open_by <= RESIDUAL_ROUNDING)
        length = np.abs(dx).max(axis=1, initial=0.0)
        last[active] = np.where(final, length, np.inf)
        long = length > LONGEST_STEP
        dx[long] *= (LONGEST_STEP / length[long])[:, None]
        trial = tree.integrate(q[active], dx * problem.col_scale)
        motion = tree.sweep(trial)
        new = problem.residual(trial, samples[active], motion)
        after = np.linalg.norm(new, axis=1)
        good = (after < size[active]) | (length < NEVER_DAMPED)
        kept = active[good]
        q[kept], residual[kept] = trial[good], new[good]
        size = size.copy()
        size[kept] = after[good]
        lower = damping[active] / 10
        damping[active] = np.where(good, np.where(lower < 1e-9, 0.0, lower), damping[active] * 10 + 1e-6)
        done = (length <= SMALLEST_STEP) & final | (damping[active] > 1e6)
        if enough < np.inf:
            course = [*course[-PATIENCE:], size]
            stalled = course[-1] > enough * course[0]
            done |= (len(course) > PATIENCE) & (open_by > RESIDUAL_ROUNDING) & stalled[active]
        if done.all():
            break
        active = active[~done]
        motion = tree.sweep(q[active]) if not good.all() else motion.take(~done) if done.any() else motion
    return Closed(q, np.abs(residual).max(axis=1, initial=0.0), last, spent)
