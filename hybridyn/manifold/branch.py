"""The branch that a motion is on where closures lose rank: a flat four-bar, rhombic loops in one line.

At such a posture several motions are possible for an instant, and they part there. A mechanism that passes
through at speed stays on the one that is smooth. Let N be the left null space of the rows K there; on that
branch K v = 0 holds before, at and after the posture, so its derivatives there give what K itself leaves
open:

    N^T K' x = 0                                tangents x, K' the derivative of K along the velocity v
    N^T (K' a + gamma_v[a] + gamma') = 0        accelerations a, from the derivative of K a + gamma = 0

They are the limits of the weak rows over their size. A posture close by is treated likewise where its weak
rows are rounding, or where the posture is off the branch by more than they can tell: across the branch a
position is known to 1e-16 over the distance, a tangent then to that over the distance, an acceleration to
that over the distance once more.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..errors import SingularityError
from ..linkage.reduction import Basis
from ..spatial import Array
from ..structure.state import ModuleState

#: Singular values below this part of the largest are replaced by their limits: an error of this size, where
#: positions, known to 1e-16 over it across the branch, would leave one of 1e-16 over its square.
LOST_RATES = 5e-6
#: Accelerations lose two powers more of the distance; below this their limits are better, their error is its
#: square.
LOST_ACCELERATIONS = 5e-4
#: Weak rows whose distances differ by this part are lost at different postures.
ALIKE = 0.1
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
BRANCH_DIFFERENCE = 1e-3


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
    lost: float = LOST_RATES,
) -> Branch | None:
    """Give the branch that a velocity is on, where some rows of K are weak; None where none are, or at rest.

    Args:
        K: Scaled closure rows, shape (rows, n).
        rank: Number of rows that count.
        v: Scaled velocity, shape (n,).
        along: Gives the derivative of K along a direction, shape (rows, n).
        name: The module's name.
        parts: U, s, Vt of K, where they are known.
        lost: Part of the largest singular value below which rows are weak.

    Raises:
        SingularityError: The velocity is possible for an instant, but on no branch.
    """
    U, s, Vt = parts if parts is not None else np.linalg.svd(K)
    speed = float(np.linalg.norm(v))
    if not rank or speed == 0.0 or s[rank - 1] > WEAK * s[0]:
        return None
    direction = v / speed
    broken = np.abs(U[:, :rank].T @ (K @ direction)) > BROKEN * s[:rank]
    weak = (s[:rank] <= lost * s[0]) | (broken & (s[:rank] <= WEAK * s[0]))
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
    """Return f'(0), by differences of fourth order."""
    h = BRANCH_DIFFERENCE
    out: Array = (8 * (f(h) - f(-h)) - (f(2 * h) - f(-2 * h))) / (12 * h)
    return out


def along_branch(state: ModuleState, basis: Basis) -> Basis:
    """Return the motions of a module, those of the branch that it is on where its closures lose rank.

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


class _Path:
    """The branch about one sample, at unit speed: its postures, rows and drift terms, scaled.

    Attributes:
        bend: Its acceleration at the sample, shape (n,).
    """

    def __init__(self, state: ModuleState, t: int, direction: Array) -> None:
        self._m, self._q, self.direction = state.mechanism, state.q[t : t + 1], direction
        self.bend = np.zeros_like(direction)

    def at(self, s: float) -> tuple[Array, Array]:
        """Return posture and velocity after a way s, shapes (1, nq), (n,)."""
        unit = self._m.reduction.col_scale
        q = self._m.tree.integrate(self._q, ((s * self.direction + s * s / 2 * self.bend) * unit)[None])
        return q, self.direction + s * self.bend

    def rows(self, q: Array, moved: Array) -> Array:
        """Return the rows at a displacement from a posture, shape (rows, n)."""
        m = self._m
        x = m.tree.integrate(q, (moved * m.reduction.col_scale)[None])
        out: Array = m.reduction.scaled(m.closures.matrix(m.tree.sweep(x)))[0]
        return out

    def gamma(self, q: Array, moved: Array, rate: Array) -> Array:
        """Return the drift terms at a displacement from a posture for rates (k, n), shape (k, rows)."""
        m = self._m
        x = m.tree.integrate(q, (moved * m.reduction.col_scale)[None])
        rates = rate * m.reduction.col_scale
        at = np.repeat(x, len(rates), axis=0)
        out: Array = m.closures.rates(m.tree.sweep(at, rates), rates)[1] * m.reduction.row_scale
        return out

    def strong_drift(self, s: float, parts: tuple[Array, ...], strong: int) -> Array:
        """Give the drift that the strong rows ask for after a way s, shape (n,), from the rows' U, s, Vt."""
        U, size, Vt = parts
        q, v = self.at(s)
        wanted = U[:, :strong].T @ self.gamma(q, 0 * v, v[None])[0]
        out: Array = -Vt[:strong].T @ (wanted / size[:strong])
        return out

    def slopes(self, s: float) -> tuple[Array, Array, Array]:
        """Return K', K' + gamma_v and gamma' after a way s, shapes (rows, n), (rows, n), (rows,)."""
        q, v = self.at(s)
        none, each = 0 * v, np.eye(len(v))
        slope = derivative(lambda h: self.rows(q, h * v))
        bilinear = self.gamma(q, none, v + each) - self.gamma(q, none, v[None]) - self.gamma(q, none, each)
        return slope, slope + bilinear.T, derivative(lambda h: self.gamma(q, h * v, v[None])[0])


def _motions_at(state: ModuleState, t: int) -> tuple[Array, Array] | None:
    """Return tangents and drift of one sample, scaled, shapes (n, N) and (n,); None where nothing is weak.

    The weak rows, and what they ask for, are integrals of their derivatives from where rank is lost; taken by
    the midpoint rule, their error is the square of the distance.
    """
    r = state.mechanism.reduction
    K, v = r.scaled(state.K[t : t + 1])[0], state.v[t] / r.col_scale
    speed = float(np.linalg.norm(v))
    path = _Path(state, t, v / speed if speed else v)
    q = path.at(0.0)[0]
    parts = np.linalg.svd(K)
    branch = branch_of(
        K,
        r.rank,
        v,
        lambda x: derivative(lambda h: path.rows(q, h * x)),
        state.module.name,
        parts,
        LOST_ACCELERATIONS,
    )
    if branch is None:
        return None
    strong = len(branch.s)
    N, rest, slopes = parts[0][:, strong:], parts[2][strong:].T, path.slopes(0.0)
    known = path.strong_drift(0.0, parts, strong)
    path.bend = _limits(slopes, N, rest, known, r.rank - strong)[1]
    weak, limit = N.T @ K @ rest, N.T @ slopes[0] @ rest
    way = float(np.sum(weak * limit) / np.sum(limit * limit))
    if (
        np.abs(weak - way * limit).max() > ALIKE * np.abs(weak).max()
        and parts[1][strong] > LOST_RATES * parts[1][0]
    ):
        return None  # several losses, at several distances
    there = np.linalg.svd(path.rows(path.at(-way)[0], 0 * v))
    N, known_there = there[0][:, strong:], path.strong_drift(-way, there, strong)
    x0 = _limits(path.slopes(-way), N, there[2][strong:].T, known_there, r.rank - strong)[1]
    slope, both, bias = path.slopes(-way / 2)
    mean = slope, (slope + both) / 2, bias + (both - slope) @ x0 / 2  # velocities turn by both ends' mean
    Z, x0 = _limits(mean, N, rest, known, r.rank - strong)
    return Z, x0 * speed**2


def _limits(
    slopes: tuple[Array, Array, Array], N: Array, rest: Array, known: Array, k: int
) -> tuple[Array, Array]:
    """Return tangents and drift from the limits of k weak rows.

    Args:
        slopes: K', K' + gamma_v and gamma', as `_Path.slopes` gives them.
        N: Left null space of the rows where rank is lost.
        rest: Motions that the strong rows allow, shape (n, n - strong).
        known: The drift that the strong rows ask for, shape (n,).
        k: Number of weak rows.
    """
    P, _, Qt = np.linalg.svd(N.T @ slopes[0] @ rest)
    left, free = P[:, :k].T @ N.T, rest @ Qt[:k].T
    x0 = known - free @ np.linalg.solve(left @ slopes[1] @ free, left @ (slopes[1] @ known + slopes[2]))
    return rest @ Qt[k:].T, x0
