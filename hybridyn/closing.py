"""Newton on the closures of one module, for many starts at once.

Every step is the least-norm Gauss-Newton step on as many singular values as the closures generically have, limited
in length (a trust region in scaled coordinates) and damped while it does not help.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .closure import Closures
from .reduction import RANK_TOLERANCE
from .spatial import Array

#: Longest step of one iteration in scaled coordinates [rad, module lengths].
LONGEST_STEP = 0.5
#: Newton has converged when its next step is this small: the rounding of positions of order one.
SMALLEST_STEP = 1e-13


@dataclass(frozen=True)
class Closed:
    """What Newton reached from each start.

    Attributes:
        q: Positions, shape (T, nq).
        residual: Scaled residual of the worst row, shape (T,).
        step: Length of the next step: how far the projection on the closures' generic range is from zero, (T,).
        iterations: Iterations spent.
    """

    q: Array
    residual: Array
    step: Array
    iterations: int


def close(
    closures: Closures,
    q: Array,
    row_scale: Array,
    col_scale: Array,
    *,
    free: Array | None = None,
    rank: int | None = None,
    iterations: int = 60,
) -> Closed:
    """Close the loops of a module from the positions given.

    Args:
        closures: The module's closures and their tree.
        q: Starts, shape (T, nq).
        row_scale: Factor of each row, shape (rows,).
        col_scale: Unit of each freedom, shape (nv,).
        free: Which freedoms may move, shape (nv,) of bool; all where left out.
        rank: Number of singular values that count; those above `RANK_TOLERANCE` where left out.
        iterations: Most iterations.
    """
    tree = closures.tree
    free = np.ones(tree.nv, dtype=bool) if free is None else free
    q = q.copy()
    T = len(q)
    residual = closures.residual(q, tree.sweep(q)) * row_scale
    damping, last = np.zeros(T), np.full(T, np.inf)
    active = np.arange(T)
    spent = 0
    for spent in range(1, iterations + 1):  # noqa: B007 - the count is reported
        motion = tree.sweep(q[active])
        K = closures.matrix(motion)[:, :, free] * row_scale[:, None] * col_scale[free]
        dx = np.zeros((len(active), tree.nv))
        dx[:, free] = _step(K, residual[active], damping[active], rank)
        length = np.abs(dx).max(axis=1, initial=0.0)
        last[active] = length
        dx *= np.minimum(1.0, LONGEST_STEP / np.where(length > 0, length, 1.0))[:, None]
        trial = tree.integrate(q[active], dx * col_scale)
        new = closures.residual(trial, tree.sweep(trial)) * row_scale
        before, after = (np.linalg.norm(r, axis=1) for r in (residual[active], new))
        good = (after < before) | (length < 1e-6)
        q[active[good]], residual[active[good]] = trial[good], new[good]
        lower = damping[active] / 10
        damping[active] = np.where(good, np.where(lower < 1e-9, 0.0, lower), damping[active] * 10 + 1e-6)
        stuck = damping[active] > 1e6
        active = active[(length > SMALLEST_STEP) & ~stuck]
        if not len(active):
            break
    return Closed(q, np.abs(residual).max(axis=1, initial=0.0), last, spent)


def _step(K: Array, residual: Array, damping: Array, rank: int | None) -> Array:
    """Give the damped least-norm step on the leading singular values, shape (T, columns)."""
    if 0 in K.shape:
        return np.zeros((len(K), K.shape[2]))
    U, s, Vt = np.linalg.svd(K, full_matrices=False)
    top = s[:, :1]
    keep = s > RANK_TOLERANCE * top if rank is None else (np.arange(s.shape[1]) < rank) & (s > 0)
    gain = np.where(keep, s / np.where(keep, s * s + damping[:, None] * top**2, 1.0), 0.0)
    return -np.einsum("bji,bj->bi", Vt, gain * np.einsum("bji,bj->bi", U, residual))


def generic_postures(
    closures: Closures, home: Array, row_scale: Array, col_scale: Array, tolerance: float, *, count: int = 24
) -> tuple[Array, float]:
    """Draw assembled postures about a home posture, from which rank and mobility are read.

    Starts spread wider and wider (seeded, so that a robot always gets the same) until enough of them close.

    Args:
        closures: The module's closures.
        home: Where to start, shape (nq,).
        row_scale: Factor of each row.
        col_scale: Unit of each freedom.
        tolerance: Largest scaled residual that counts as closed (rounding in the file).
        count: How many postures are wanted.

    Returns:
        Postures, shape (at most count, nq), none where nothing closed, and the best residual seen.
    """
    rng = np.random.default_rng(2010)
    tree = closures.tree
    found: list[Array] = []
    best = np.inf
    for spread, starts in ((0.15, 2 * count), (0.5, 4 * count), (1.5, 8 * count), (3.0, 16 * count)):
        noise = rng.uniform(-spread, spread, (starts, tree.nv)) * col_scale
        q = tree.integrate(np.tile(home, (starts, 1)), noise)
        closed = close(closures, q, row_scale, col_scale)
        best = min(best, float(closed.residual.min(initial=np.inf)))
        found.extend(closed.q[(closed.residual <= tolerance) & (closed.step < 1e-6)])
        if len(found) >= count:
            break
    return np.array(found[:count]).reshape(-1, tree.nq), best
