"""Newton's method on rows over the freedoms of a tree, such as `LoopProblem`, for a batch of starts.

Each step is the least-norm Gauss-Newton step, truncated to the generic rank of the rows. Its length is
limited (a trust region in scaled coordinates), and it is damped while the residual does not decrease.
"""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np

from ..spatial import Array, Index, Mask, einsum

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


class Step(NamedTuple):
    """A step of Newton's method.

    Attributes:
        dx: The step, scaled, shape (T, nv).
        length: Its largest entry, shape (T,).
        open_by: Largest scaled residual before it, shape (T,).
    """

    dx: Array
    length: Array
    open_by: Array


def newton_step(problem: Problem, K: Any, residual: Array, damping: Array | None = None) -> Step:
    """Compute the step that makes a problem's rows zero.

    A long step that residuals of rounding ask for is rounding over a lost singular value: none is taken.

    Args:
        K: The scaled rows at the postures.
        residual: Their scaled residuals, shape (T, rows).
        damping: As `Problem.solve` takes it.
    """
    dx = problem.solve(K, -residual, damping)
    length, open_by = (np.abs(x).max(axis=1, initial=0.0) for x in (dx, residual))
    lost = (open_by <= RESIDUAL_ROUNDING) & (length > NEVER_DAMPED)
    if lost.any():
        dx[lost], length[lost] = 0.0, 0.0
    return Step(dx, length, open_by)


class _Starts(NamedTuple):
    """Starts that go on, and where they are.

    Attributes:
        number: Number of each start, shape (T,).
        sample: Its index into the targets' samples, shape (T,).
        q: Positions, shape (T, nq).
        residual: Scaled residuals there, shape (T, rows).
        size: Their lengths, shape (T,).
        damping: As `Problem.solve` takes it, shape (T,).
    """

    number: Index
    sample: Index
    q: Array
    residual: Array
    size: Array
    damping: Array

    def take(self, chosen: Mask) -> _Starts:
        """Return some of the starts."""
        return _Starts._make(x[chosen] for x in self)

    def stepped(self, good: Mask, q: Array, residual: Array, size: Array) -> _Starts:
        """Return the starts after a step where it is good; the others stay, and are damped more."""
        lower = self.damping / 10
        lower[lower < 1e-9] = 0.0
        if not good.all():
            each = good[:, None]
            q, residual = np.where(each, q, self.q), np.where(each, residual, self.residual)
            size, lower = np.where(good, size, self.size), np.where(good, lower, self.damping * 10 + 1e-6)
        return _Starts(self.number, self.sample, q, residual, size, lower)


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
    T, at = len(q), np.zeros(len(q), dtype=int) if samples is None else samples
    found, worst, last, spent = np.empty_like(q), np.empty(T), np.empty(T), 0
    motion = problem.tree.sweep(q)
    residual = problem.residual(q, at, motion)
    on = _Starts(np.arange(T), at, q, residual, _sizes(residual), np.zeros(T))
    course = [on.size]
    for spent in range(1, iterations + 1):
        K = problem.matrix(motion, on.sample, every=False)
        step = newton_step(problem, K, on.residual, on.damping)
        final = least | (on.damping == 0.0) | (step.open_by <= RESIDUAL_ROUNDING)
        trial = problem.tree.integrate(on.q, _limited(step) * problem.col_scale)
        motion = problem.tree.sweep(trial)
        residual = problem.residual(trial, on.sample, motion)
        size = _sizes(residual)
        good = (size < on.size) | (step.length < NEVER_DAMPED)
        on = on.stepped(good, trial, residual, size)
        done = (step.length <= SMALLEST_STEP) & final | (on.damping > 1e6)
        if enough < np.inf:
            course = [*course[-PATIENCE:], on.size]
            stalled = on.size > enough * course[0]
            done |= (len(course) > PATIENCE) & (step.open_by > RESIDUAL_ROUNDING) & stalled
        if done.any() or not T or spent == iterations:
            found[on.number], worst[on.number] = on.q, np.abs(on.residual).max(axis=1, initial=0.0)
            last[on.number] = np.where(final, step.length, np.inf)
            if done.all():
                break
            on, motion, course = on.take(~done), motion.take(~done), [x[~done] for x in course]
        if not good.all():
            motion = problem.tree.sweep(on.q)
    return Closed(found, worst, last, spent)


def _sizes(residual: Array) -> Array:
    """Compute the lengths of residuals, shape (T, rows)."""
    out: Array = np.sqrt(einsum("ti,ti->t", residual, residual))
    return out


def _limited(step: Step) -> Array:
    """Return steps that are no longer than `LONGEST_STEP`, shape (T, nv)."""
    long = step.length > LONGEST_STEP
    if long.any():
        step.dx[long] *= (LONGEST_STEP / step.length[long])[:, None]
    return step.dx
