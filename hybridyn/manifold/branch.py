"""Branches of motion where closures lose rank, as in a flat four-bar or collinear rhombic loops.

At such a posture several branches of motion meet. A mechanism that passes through it at nonzero speed stays
on the smooth one. Let N be the left null space of the rows K there. On that branch K v = 0 holds before, at
and after the posture, so its derivatives determine what K itself does not:

    N^T K' x = 0                                tangents x, K' the derivative of K along the velocity v
    N^T (K' a + gamma_v[a] + gamma') = 0        accelerations a, from the derivative of K a + gamma = 0

Here gamma(q, v) = K' v is quadratic in v; gamma_v[a] is its derivative by v along a, and gamma' its
derivative by q along v. The term K a_dot of the derivative vanishes, since N^T K = 0.
These are the limits of the weak rows divided by their size. A nearby posture is treated in the same way if
its weak rows are rounding, or if its deviation from the branch exceeds their resolution. At a distance d, a
position across the branch is known to 1e-16 / d, a tangent to 1e-16 / d^2, an acceleration to 1e-16 / d^3.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..errors import SingularityError
from ..linkage.reduction import Basis
from ..spatial import Array
from ..structure.module import ModuleState

#: Singular values below this part of the largest are replaced by their limits, with an error of this size
#: d. Without the replacement the error would be 1e-16 / d^2, since positions are known to 1e-16 / d.
LOST_RATES = 5e-6
#: The same for accelerations, whose error has two more powers of the distance; the error of their limits is
#: the square of this.
LOST_ACCELERATIONS = 5e-4
#: Weak rows whose distances differ by more than this part lose rank at different postures.
ALIKE = 0.1
#: Singular values below this are checked: rows that the velocity violates are replaced as well.
WEAK = 1e-3
#: Largest violation of a weak row by the velocity, relative to its singular value.
BROKEN = 1e-2
#: Least size of the limits. Below it branches touch without crossing, or a higher derivative is needed.
CROSSING = 1e-6
#: A velocity that violates the limits by `ASTRAY` is on no branch, if the rows are as weak as `AT_ONCE`.
#: Farther away, accelerations contribute to the violation.
ASTRAY, AT_ONCE = 1e-4, 1e-10
#: Step of the fourth-order differences, in scaled coordinates.
BRANCH_DIFFERENCE = 1e-3


class Branch(NamedTuple):
    """The scaled rows of one posture, with weak rows, if any, replaced by their limits.

    Attributes:
        U: Left vectors of the independent rows, shape (rows, rank), the weak ones last.
        V: Orthonormal directions that the rows determine, shape (n, rank).
        Z: Tangents of the branch, shape (n, n - rank).
        s: Singular values of the strong rows, shape (strong,).
    """

    U: Array
    V: Array
    Z: Array
    s: Array


def branch_of(
    K: Array, rank: int, v: Array, along: Callable[[Array], Array], name: str, parts: tuple[Array, ...],
    lost: float = LOST_RATES,
) -> Branch:  # fmt: skip
    """Compute the branch of a velocity; all rows of K are strong if none is weak, or at rest.

    Args:
        K: Scaled closure rows, shape (rows, n).
        rank: Number of independent rows.
        v: Scaled velocity, shape (n,).
        along: Function that computes the derivative of K along a direction, shape (rows, n).
        name: The module's name.
        parts: U, s, Vt of K.
        lost: Part of the largest singular value below which rows are weak.

    Raises:
        SingularityError: The velocity satisfies K v = 0, but is on no branch.
    """
    U, s, Vt = parts
    regular = Branch(U[:, :rank], Vt[:rank].T, Vt[rank:].T, s[:rank])
    speed = float(np.linalg.norm(v))
    if not rank or speed == 0.0 or s[rank - 1] > WEAK * s[0]:
        return regular
    direction = v / speed
    broken = np.abs(U[:, :rank].T @ (K @ direction)) > BROKEN * s[:rank]
    weak = (s[:rank] <= lost * s[0]) | (broken & (s[:rank] <= WEAK * s[0]))
    if not weak.any():
        return regular
    return _crossing(rank, int(np.argmax(weak)), direction, along(direction), name, parts) or regular


def _crossing(
    rank: int, strong: int, direction: Array, K_dot: Array, name: str, parts: tuple[Array, ...]
) -> Branch | None:
    """Compute the branch of a direction from the limits of the weak rows; None if no branches cross.

    Args:
        rank: Number of independent rows.
        strong: Number of those that are not weak.
        direction: The scaled direction, of length one, shape (n,).
        K_dot: Derivative of the scaled rows along it, shape (rows, n).
        name: The module's name.
        parts: U, s, Vt of the rows.

    Raises:
        SingularityError: The direction satisfies the rows, but is on no branch.
    """
    U, s, Vt = parts
    N, rest = U[:, strong:], Vt[strong:].T
    limits = N.T @ K_dot
    P, size, Qt = np.linalg.svd(limits @ rest)
    k = rank - strong
    if len(size) < k or size[k - 1] < CROSSING:
        return None
    if s[strong] <= AT_ONCE * s[0] and np.abs(limits @ direction).max() > ASTRAY * size[0]:
        raise SingularityError(
            f"module '{name}': its closures lose rank here, and the velocity is on none of the branches "
            "that meet there, so no motion can continue with it. Give it the velocity of one branch",
            module=name, what="closures", condition=float(s[0] / s[rank - 1]) if s[rank - 1] > 0 else np.inf,
        )  # fmt: skip
    return Branch(
        np.hstack([U[:, :strong], N @ P[:, :k]]),
        np.hstack([Vt[:strong].T, rest @ Qt[:k].T]),
        rest @ Qt[k:].T,
        s[:strong],
    )


def derivative(f: Callable[[float], Array]) -> Array:
    """Compute f'(0) by fourth-order central differences."""
    h = BRANCH_DIFFERENCE
    return (8 * (f(h) - f(-h)) - (f(2 * h) - f(-2 * h))) / (12 * h)


def along_branch(state: ModuleState, basis: Basis) -> Basis:
    """Compute the motions of a module; where its closures lose rank, those of its branch.

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
    return Basis(Psi, drift, pivot, basis.surplus)


class _Path:
    """The branch near one sample at unit speed: postures, scaled rows and drift terms.

    Attributes:
        bend: Its acceleration at the sample, shape (n,).
    """

    def __init__(self, state: ModuleState, t: int, direction: Array) -> None:
        self._m, self._q, self.direction = state.mechanism, state.q[t : t + 1], direction
        self.bend = np.zeros_like(direction)

    def _moved(self, q: Array, x: Array) -> Array:
        """Compute the posture at a scaled displacement x from a posture, shapes (n,), (1, nq)."""
        return self._m.tree.integrate(q, (x * self._m.reduction.col_scale)[None])

    def at(self, s: float) -> tuple[Array, Array]:
        """Compute posture and velocity at path length s, shapes (1, nq), (n,)."""
        x = s * self.direction + s * s / 2 * self.bend
        return self._moved(self._q, x), self.direction + s * self.bend

    def rows(self, q: Array, x: Array) -> Array:
        """Compute the rows at a displacement from a posture, shape (rows, n)."""
        motion = self._m.tree.sweep(self._moved(q, x))
        out: Array = self._m.reduction.scaled(self._m.closures.matrix(motion))[0]
        return out

    def gamma(self, q: Array, x: Array, rate: Array) -> Array:
        """Compute the drift terms at a displacement from a posture for rates (k, n), shape (k, rows)."""
        m, rates = self._m, rate * self._m.reduction.col_scale
        at = np.repeat(self._moved(q, x), len(rates), axis=0)
        return m.closures.rates(m.tree.sweep(at, rates), rates)[1] * m.reduction.row_scale

    def strong_drift(self, s: float, parts: tuple[Array, ...], strong: int) -> Array:
        """Compute the drift that the strong rows determine at path length s, (n,), from their U, s, Vt."""
        U, size, Vt = parts
        q, v = self.at(s)
        wanted = U[:, :strong].T @ self.gamma(q, 0 * v, v[None])[0]
        out: Array = -Vt[:strong].T @ (wanted / size[:strong])
        return out

    def slopes(self, s: float) -> tuple[Array, Array, Array]:
        """Compute K', K' + gamma_v and gamma' at path length s, shapes (rows, n), (rows, n), (rows,)."""
        q, v = self.at(s)
        none, each = 0 * v, np.eye(len(v))
        slope = derivative(lambda h: self.rows(q, h * v))
        bilinear = self.gamma(q, none, v + each) - self.gamma(q, none, v[None]) - self.gamma(q, none, each)
        return slope, slope + bilinear.T, derivative(lambda h: self.gamma(q, h * v, v[None])[0])


def _motions_at(state: ModuleState, t: int) -> tuple[Array, Array] | None:
    """Compute scaled tangents and drift of one sample, shapes (n, N) and (n,); None if no row is weak.

    The weak rows and their right-hand sides are integrals of their derivatives from the posture where rank is
    lost. The midpoint rule approximates them with an error of the square of the distance.
    """
    r = state.mechanism.reduction
    K, v = r.scaled(state.K[t : t + 1])[0], state.v[t] / r.col_scale
    speed = float(np.linalg.norm(v))
    path = _Path(state, t, v / speed if speed else v)
    q = path.at(0.0)[0]
    parts, name = np.linalg.svd(K), state.module.name

    def along(x: Array) -> Array:
        """Compute the derivative of the rows along a direction."""
        return derivative(lambda h: path.rows(q, h * x))

    strong = len(branch_of(K, r.rank, v, along, name, parts, LOST_ACCELERATIONS).s)
    if strong == r.rank:
        return None
    N, rest, slopes = parts[0][:, strong:], parts[2][strong:].T, path.slopes(0.0)
    known = path.strong_drift(0.0, parts, strong)
    path.bend = _limits(slopes, N, rest, known, r.rank - strong)[1]
    weak, limit = N.T @ K @ rest, N.T @ slopes[0] @ rest
    way = float(np.sum(weak * limit) / np.sum(limit * limit))
    if (
        np.abs(weak - way * limit).max() > ALIKE * np.abs(weak).max()
        and parts[1][strong] > LOST_RATES * parts[1][0]
    ):
        return None  # rank is lost at several postures, at different distances
    there = np.linalg.svd(path.rows(path.at(-way)[0], 0 * v))
    N, known_there = there[0][:, strong:], path.strong_drift(-way, there, strong)
    x0 = _limits(path.slopes(-way), N, there[2][strong:].T, known_there, r.rank - strong)[1]
    slope, both, bias = path.slopes(-way / 2)
    mean = slope, (slope + both) / 2, bias + (both - slope) @ x0 / 2  # velocities: the mean of both ends
    Z, x0 = _limits(mean, N, rest, known, r.rank - strong)
    return Z, x0 * speed**2


def _limits(
    slopes: tuple[Array, Array, Array], N: Array, rest: Array, known: Array, k: int
) -> tuple[Array, Array]:
    """Compute tangents and drift from the limits of k weak rows.

    Args:
        slopes: K', K' + gamma_v and gamma' from `_Path.slopes`.
        N: Left null space of the rows where rank is lost.
        rest: Null space of the strong rows, shape (n, n - strong).
        known: The drift that the strong rows determine, shape (n,).
        k: Number of weak rows.
    """
    P, _, Qt = np.linalg.svd(N.T @ slopes[0] @ rest)
    left, free = P[:, :k].T @ N.T, rest @ Qt[:k].T
    x0 = known - free @ np.linalg.solve(left @ slopes[1] @ free, left @ (slopes[1] @ known + slopes[2]))
    return rest @ Qt[k:].T, x0
