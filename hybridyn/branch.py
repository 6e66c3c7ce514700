"""The branch that a motion is on where closures lose rank: a flat four-bar, rhombic loops in one line.

At such a posture several motions are possible for an instant, and they part there. A mechanism that passes
through at speed stays on the one that is smooth. Let N be the left null space of the rows K there; on that
branch K v = 0 holds before, at and after the posture, so its derivatives there give what K itself leaves
open:

    N^T K' x = 0                                tangents x, K' the derivative of K along the velocity v
    N^T (K' a + gamma_v[a] + gamma') = 0        accelerations a, from the derivative of K a + gamma = 0

They are the limits of the weak rows over their size. A posture close by is treated likewise where its weak
rows are rounding, or where the posture is off the branch by more than they can tell.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .errors import SingularityError
from .forward import ModuleState
from .reduction import Basis
from .spatial import Array

#: Singular values below this part of the largest are replaced by their limits: an error of this size, where
#: positions, known to 1e-16 over it across the branch, would leave one of 1e-16 over its square.
LOST = 5e-6
#: Singular values below this are looked at: rows that the velocity does not obey are replaced as well.
WEAK = 1e-3
#: Part of a weak singular value that the velocity may break.
BROKEN = 1e-2
#: Least size of the limits: below, branches touch instead of crossing, or a higher derivative would decide.
CROSSING = 1e-6
#: A velocity that breaks the limits by this part lies on none of the branches, where rows are this weak:
#: farther away, accelerations have a share in what it breaks.
ASTRAY, AT_ONCE = 1e-4, 1e-10
#: Step of the differences of fourth order, in scaled coordinates.
DIFFERENCE = 1e-3


@dataclass(frozen=True)
class Branch:
    """The rows of one posture, in scaled coordinates, weak ones replaced by their limits.

    Attributes:
        U: Left vectors of the rows that count, shape (rows, rank), the weak ones last.
        V: What they determine, shape (n, rank).
        Z: Tangents of the branch, shape (n, n - rank).
        s: Singular values of the strong rows, shape (strong,).
    """

    U: Array
    V: Array
    Z: Array
    s: Array


def branch_of(
    K: Array,
    rank: int,
    v: Array,
    along: Callable[[Array], Array],
    name: str,
    parts: tuple[Array, ...] | None = None,
) -> Branch | None:
    """Give the branch that a velocity is on, where some rows of K are weak; None where none are, or at rest.

    Args:
        K: Scaled closure rows, shape (rows, n).
        rank: Number of rows that count.
        v: Scaled velocity, shape (n,).
        along: Gives the derivative of K along a direction, shape (rows, n).
        name: The module's name.
        parts: U, s, Vt of K, where they are known.

    Raises:
        SingularityError: The velocity is possible for an instant, but on no branch.
    """
    U, s, Vt = parts if parts is not None else np.linalg.svd(K)
    speed = float(np.linalg.norm(v))
    if not rank or speed == 0.0 or s[rank - 1] > WEAK * s[0]:
        return None
    direction = v / speed
    broken = np.abs(U[:, :rank].T @ (K @ direction)) > BROKEN * s[:rank]
    weak = (s[:rank] <= LOST * s[0]) | (broken & (s[:rank] <= WEAK * s[0]))
    if not weak.any():
        return None
    strong = int(np.argmax(weak))
    N, rest = U[:, strong:], Vt[strong:].T
    limits = N.T @ along(direction)
    P, size, Qt = np.linalg.svd(limits @ rest)
    k = rank - strong
    if len(size) < k or size[k - 1] < CROSSING:
        return None
    if s[strong] <= AT_ONCE * s[0] and np.abs(limits @ direction).max() > ASTRAY * size[0]:
        raise SingularityError(
            f"module '{name}': its closures lose rank here, and the velocity lies on none of the branches "
            "that meet: no motion goes on with it. Give it the velocity of one branch",
            module=name, what="closures", condition=float(s[0] / s[rank - 1]) if s[rank - 1] > 0 else np.inf,
        )  # fmt: skip
    return Branch(
        np.hstack([U[:, :strong], N @ P[:, :k]]),
        np.hstack([Vt[:strong].T, rest @ Qt[:k].T]),
        rest @ Qt[k:].T,
        s[:strong],
    )


def derivative(f: Callable[[float], Array]) -> Array:
    """Give f'(0), by differences of fourth order."""
    h = DIFFERENCE
    out: Array = (8 * (f(h) - f(-h)) - (f(2 * h) - f(-2 * h))) / (12 * h)
    return out


def along_branch(state: ModuleState, basis: Basis) -> Basis:
    """Give the motions of a module, those of the branch that it is on where its closures lose rank.

    Args:
        state: The module's state.
        basis: Its motions as the elimination gave them.

    Raises:
        SingularityError: A velocity is on no branch.
    """
    near = np.flatnonzero((basis.pivot < WEAK) & state.v.any(axis=1))
    if not len(near) or not state.mechanism.reduction.rank:
        return basis
    Psi, drift, pivot = basis.Psi.copy(), basis.drift.copy(), basis.pivot.copy()
    unit = state.mechanism.reduction.col_scale
    for t in near:
        found = _motions_at(state, int(t))
        if found is not None:
            Psi[t], drift[t], pivot[t] = found[0] * unit[:, None], found[1] * unit, 1.0
    return Basis(Psi, drift, pivot)


def _motions_at(state: ModuleState, t: int) -> tuple[Array, Array] | None:
    """Give tangents and drift of one sample, scaled, shapes (n, N) and (n,)."""
    m = state.mechanism
    r, q, v = m.reduction, state.q[t : t + 1], state.v[t] / m.reduction.col_scale
    speed = float(np.linalg.norm(v))

    def moved(s: float, direction: Array) -> Array:
        return m.tree.integrate(q, s * (direction * r.col_scale)[None])

    def rows(s: float, direction: Array) -> Array:
        out: Array = r.scaled(m.closures.matrix(m.tree.sweep(moved(s, direction))))[0]
        return out

    def gamma(x: Array, rate: Array) -> Array:
        rates = rate * r.col_scale
        at = np.repeat(x, len(rates), axis=0)
        out: Array = m.closures.rates(m.tree.sweep(at, rates), rates)[1] * r.row_scale
        return out

    def slope(direction: Array) -> Array:
        return derivative(lambda s: rows(s, direction))

    branch = branch_of(r.scaled(state.K[t : t + 1])[0], r.rank, v, slope, state.module.name)
    if branch is None:
        return None
    direction, each = v / speed, np.eye(len(v))
    bilinear = gamma(q, direction + each) - gamma(q, direction[None]) - gamma(q, each)
    B = slope(direction) + bilinear.T
    D = derivative(lambda s: gamma(moved(s, direction), direction[None])[0]) * speed**2
    strong = len(branch.s)
    x0 = -branch.V[:, :strong] @ (branch.U[:, :strong].T @ gamma(q, v[None])[0] / branch.s)
    left, free = branch.U[:, strong:].T, branch.V[:, strong:]
    x0 -= free @ np.linalg.solve(left @ B @ free, left @ (B @ x0 + D))
    return branch.Z, x0
