"""Walk from a closed posture along the motions that its loops leave, to postures far from singular ones.

Near a singular posture, rows that are independent nearly depend on each other, and chance decides in which of
a linkage's modes a start close to it closes. A walk stays in the mode that it starts in.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..spatial import Array, Index
from .elimination import size_of_rows
from .loop_problem import LoopProblem
from .motion import Motion
from .newton import close
from .reduction import RANK_GAP, RANK_TOLERANCE, ROUNDED_ROWS

#: Postures with a residual below this are closed to the last digit.
CLOSED = 1e-11
#: A singular value this many times as large as the residual does not come from the same rounding.
EVIDENT = 1e3
#: Number of walks and of their steps; first and longest step [rad, module lengths].
WALKS, STEPS, FIRST, LONGEST = 6, 8, 0.1, 0.4
#: Newton's method closes a step within so many iterations, and moves it aside by less than this part of its
#: length. If it needs more, the walk has come close to another mode, and tries a step of a quarter.
ITERATIONS, ASIDE, SHORTER = 12, 0.5, 0.25
#: How far a walk turns at a step.
TURN = 0.3


class Walked(NamedTuple):
    """Postures of walks.

    Attributes:
        q: Positions, shape (postures, nq).
        values: Relative singular values of the rows there, shape (postures, values).
    """

    q: Array
    values: Array


class Level(NamedTuple):
    """How precisely loops close, and what their singular values say then.

    Attributes:
        closed: Largest scaled residual of a closed posture.
        rounding: Relative singular value up to which rows count as dependent.
        evident: Relative singular value from which on rows are independent, whatever was rounded.
    """

    closed: float
    rounding: float
    evident: float

    @classmethod
    def of(cls, residual: float, tolerance: float) -> Level:
        """Return the level of a posture with a residual of at most `tolerance`, that of closed postures."""
        by_residual = EVIDENT * residual
        return cls(
            CLOSED if residual <= CLOSED else tolerance,
            min(max(by_residual, ROUNDED_ROWS), RANK_TOLERANCE),
            max(by_residual, RANK_TOLERANCE),
        )


def relative_values(problem: LoopProblem, motion: Motion) -> Array:
    """Compute the relative singular values of the rows in a motion of the tree, shape (T, values)."""
    s = np.linalg.svd(problem.matrix(motion), compute_uv=False).astype(float)
    return s / size_of_rows(s, RANK_TOLERANCE)


def _with_vectors(problem: LoopProblem, q: Array) -> tuple[Array, Array]:
    """Compute relative singular values, shape (T, values), and right singular vectors as rows."""
    _, s, Vt = np.linalg.svd(problem.matrix(problem.tree.sweep(q)), full_matrices=False)
    values: Array = s / size_of_rows(s, RANK_TOLERANCE)
    return values, Vt


def ranks(values: Array, tolerance: float) -> Index:
    """Count the relative singular values above a tolerance, shape (T,)."""
    out: Index = (values > tolerance).sum(axis=1)
    return out


def walk(problem: LoopProblem, start: Array, level: Level) -> Walked:
    """Walk from a closed posture in random directions (seeded), at no loss of rank.

    Args:
        problem: The rows, and all freedoms of their tree.
        start: The posture, shape (nq,).
        level: How precisely it is closed.

    Returns:
        The posture of every step that closed. There is none if the start has no motion, or is singular, so
        that its own rows do not determine the way.
    """
    rng, tree = np.random.default_rng(2010), problem.tree
    q = np.tile(start, (WALKS, 1))
    values, Vt = _with_vectors(problem, q)
    rank = int(ranks(values, level.rounding)[0])
    fixed = replace(problem, rank=rank)
    heading, length = rng.normal(size=(WALKS, tree.nv)), np.full(WALKS, FIRST)
    found = [Walked(q[:0], values[:0])]
    for _ in range(STEPS if rank < tree.nv else 0):
        step = _along(Vt[:, :rank], heading)
        trial = tree.integrate(q, step * length[:, None] * problem.col_scale)
        closed = close(fixed, trial, iterations=ITERATIONS)
        aside = np.abs(tree.difference(trial, closed.q) / problem.col_scale).max(axis=1)
        there, its_Vt = _with_vectors(problem, closed.q)
        good = (closed.residual <= level.closed) & (closed.step < 1e-6) & (aside < ASIDE * length)
        good &= ranks(there, level.rounding) >= rank
        found.append(Walked(closed.q[good], there[good]))
        q[good], Vt[good] = closed.q[good], its_Vt[good]
        length = np.where(good, np.minimum(2 * length, LONGEST), SHORTER * length)
        turn = rng.normal(size=heading.shape)
        heading = np.where(good[:, None], step + TURN * turn, turn)
    return Walked(*(np.concatenate(parts) for parts in zip(*found, strict=True)))


def widest(walked: Walked, level: Level, count: int) -> Array:
    """Return postures of the largest rank at which the gap in the singular values is open, widest first.

    Args:
        walked: Postures of walks.
        level: How precisely they are closed.
        count: Largest number of postures.

    Returns:
        Shape (postures, nq).
    """
    seen = ranks(walked.values, level.rounding)
    rank = int(seen.max(initial=0))
    values = np.pad(walked.values, ((0, 0), (1, 1)))
    kept, dropped = values[:, rank], values[:, rank + 1]
    opened = (seen == rank) & (kept > np.maximum(level.evident, RANK_GAP * dropped))
    order = np.argsort(np.where(opened, -kept, 0.0), kind="stable")
    out: Array = walked.q[order[: min(count, int(opened.sum()))]]
    return out


def _along(V: Array, heading: Array) -> Array:
    """Project headings onto the motions orthogonal to rows V, shape (T, rank, nv), of largest entry one."""
    left = heading - np.einsum("tri,tr->ti", V, np.einsum("tri,ti->tr", V, heading))
    out: Array = left / np.abs(left).max(axis=1, keepdims=True)
    return out
