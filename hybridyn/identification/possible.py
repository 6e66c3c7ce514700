"""Numbers of a robot that can exist, near those that were estimated.

The standard parameters x = file + steps y minimise

    |S^-1 (K x - base)|^2 + |y / weight|^2

with the estimate's covariance S S^T, K x = base, and the numbers of the robot's file as prior. If a body
would be impossible, a conic program finds the best x for which the pseudo-inertia of each body is positive
definite (Wensing, Kim & Slotine 2018) and no friction or rotor inertia is negative. Clarabel solves it: an
interior-point method with cones of matrices, in one small package without further dependencies.

With A y - b = Q (R y - z) for the sum above, the program's variables are w = R y - z: what is minimised is
their length, however exact the estimate is in some directions and vague in others. An interior-point method
comes near to a bound, on either side by rounding. So its numbers are clipped to the bounds; and where it
fails, those of the line from the file's to the estimate are taken: a fit is never lost over this.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy import linalg, sparse

from ..errors import install_advice
from ..spatial import Array, Index
from .inertial import PLACE

#: Least eigenvalue of a pseudo-inertia, of that of a body like the prior; and least mass, of the file's.
DEFINITE = 1e-4
#: Part of these that counts as kept: the program's own tolerance is smaller.
KEPT = 0.5
#: Least standard deviation of an estimate that is believed, of the base parameter.
BELIEVED = 1e-7
#: Halvings of the step from the file's numbers to those that were estimated.
HALVINGS = 40
#: What is told where the conic program gave no answer.
ON_THE_LINE = (
    "some numbers would be impossible; the robot has those nearest to the estimate on the line from "
    "the file's"
)


class Possible(NamedTuple):
    """Standard parameters that are possible.

    Attributes:
        values: The parameters, shape (p,).
        constrained: Whether the estimate itself is not possible.
        remark: How they were found where the conic program gave none, or "".
    """

    values: Array
    constrained: bool = False
    remark: str = ""


class Bounds(NamedTuple):
    """What numbers that can exist keep to.

    Attributes:
        bodies: The ten parameters of each body.
        scales: Root of the pseudo-inertia of a body like that of the file, shape (4, 4) each.
        least: Least value of each parameter, shape (p,), -inf where there is none.
    """

    bodies: Sequence[Index]
    scales: Sequence[Array]
    least: Array

    def keep(self, x: Array, part: float = KEPT) -> bool:
        """Return whether parameters, shape (p,), keep to the bounds."""
        if (x < self.least).any():
            return False
        seen = [seen_from(x[at], scale) for at, scale in zip(self.bodies, self.scales, strict=True)]
        return not seen or bool(np.linalg.eigvalsh(seen)[:, 0].min() >= part * DEFINITE)


def pseudo_inertia(ten: Array) -> Array:
    """Return the pseudo-inertia of a body, shape (4, 4): positive definite if the body can exist.

    Args:
        ten: Mass, first moments and inertia xx, xy, yy, xz, yz, zz about the frame's origin, shape (10,).
    """
    m, h, inertia = ten[0], ten[1:4], ten[4:][PLACE]
    return np.block([[np.trace(inertia) / 2 * np.eye(3) - inertia, h[:, None]], [h, m]])


def body_scale(prior: Array) -> Array:
    """Return the square root of a body's pseudo-inertia, or that of a ball of its mass, shape (4, 4)."""
    values, vectors = np.linalg.eigh(pseudo_inertia(prior))
    floor = max(values[-1] * 1e-6, np.finfo(float).tiny)
    return np.asarray(vectors * np.sqrt(np.maximum(values, floor)))


def seen_from(ten: Array, scale: Array) -> Array:
    """Return a pseudo-inertia relative to the prior one, which is the unit matrix, shape (4, 4)."""
    left = linalg.solve(scale, pseudo_inertia(ten))
    return np.asarray(linalg.solve(scale, left.T))


def exists(ten: Array) -> bool:
    """Return whether a body of the file can exist, its pseudo-inertia definite beyond rounding."""
    return bool(np.linalg.eigvalsh(seen_from(ten, body_scale(ten)))[0] >= DEFINITE)


def consistent(
    combination: Array,
    base: Array,
    root: Array,
    prior: Array,
    steps: Array,
    bodies: Sequence[Index],
    least: Array,
    *,
    weight: float = 1.0,
) -> Possible:
    """Compute standard parameters that are physically possible and near an estimate.

    Args:
        combination: K, shape (rank, p).
        base: Estimated base parameters, shape (rank,).
        root: S with covariance S S^T, shape (rank, rank).
        prior: The numbers of the robot's file, shape (p,).
        steps: How they may change: by this much if the file is wrong altogether, a column for each free
            number, shape (p, free).
        bodies: The ten parameters of each body.
        least: Least value of each parameter, shape (p,), -inf where there is none.
        weight: How far the file may be wrong, of `steps`.
    """
    size = np.maximum(np.abs(base), np.linalg.norm(combination @ steps, axis=1)) + np.finfo(float).tiny
    U, spread, _ = linalg.svd(root / size[:, None])
    whiten = (U / np.maximum(spread, BELIEVED)).T / size
    A = np.vstack([whiten @ combination @ steps, np.eye(steps.shape[1]) / weight])
    b = np.concatenate([whiten @ (base - combination @ prior), np.zeros(steps.shape[1])])
    Q, R = linalg.qr(A, mode="economic")
    along = linalg.solve_triangular(R, steps.T, trans="T").T
    x = prior + along @ (Q.T @ b)
    bounds = Bounds(bodies, [body_scale(prior[at]) for at in bodies], least)
    if bounds.keep(x, 1.0):
        return Possible(x)
    w, why = _conic(x, along, bounds)
    found = None if w is None else _clipped(x + along @ w, bounds)
    if found is not None and bounds.keep(found):
        return Possible(found, True, why and f"the robot may not be the one nearest to the estimate: {why}")
    return Possible(_on_line(prior, _clipped(x, bounds), bounds), True, f"{ON_THE_LINE}: {why}")


def _clipped(x: Array, bounds: Bounds) -> Array:
    """Return parameters, shape (p,), none below its least value."""
    return np.maximum(x, bounds.least)


def _on_line(prior: Array, x: Array, bounds: Bounds) -> Array:
    """Return the last parameters on the line from the file's to x that keep to the bounds, or the file's."""
    good, bad = 0.0, 1.0
    for _ in range(HALVINGS):
        middle = (good + bad) / 2
        good, bad = (middle, bad) if bounds.keep(prior + middle * (x - prior)) else (good, middle)
    return _clipped(prior + good * (x - prior), bounds)


def _conic(x: Array, along: Array, bounds: Bounds) -> tuple[Array | None, str]:
    """Find the shortest w for which x + along w keeps to the bounds; return it, and what went wrong.

    The program's variables are a bound of the length, and w.
    """
    try:
        import clarabel
    except ImportError:
        return None, f"finding the nearest ones needs clarabel, {install_advice('identify')}"
    n = along.shape[1]
    length = np.zeros(n + 1), np.eye(n + 1), clarabel.SecondOrderConeT(n + 1)
    parts: list[tuple[Array, Array, Any]] = [length]

    def add(constant: Array, matrix: Array, cone: Callable[[int], Any], size: int) -> None:
        """Add rows that must lie in a cone, none of which holds the bound of the length."""
        parts.append((constant, np.hstack([np.zeros((len(matrix), 1)), matrix]), cone(size)))

    at = np.flatnonzero(np.isfinite(bounds.least))
    if len(at):
        unit = np.linalg.norm(along[at], axis=1)
        unit[unit == 0] = 1.0
        add((x - bounds.least)[at] / unit, along[at] / unit[:, None], clarabel.NonnegativeConeT, len(at))
    least = DEFINITE * _triangle(np.eye(4))
    for own, scale in zip(bounds.bodies, bounds.scales, strict=True):
        basis = np.array([_triangle(seen_from(one, scale)) for one in np.eye(10)]).T
        add(basis @ x[own] - least, basis @ along[own], clarabel.PSDTriangleConeT, 4)
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    found = clarabel.DefaultSolver(
        sparse.csc_matrix((n + 1, n + 1)), np.eye(1, n + 1)[0],
        sparse.csc_matrix(-np.vstack([matrix for _, matrix, _ in parts])),
        np.concatenate([constant for constant, _, _ in parts]), [cone for *_, cone in parts], settings,
    ).solve()  # fmt: skip
    w = np.asarray(found.x)[1:]
    why = "" if "Solved" in str(found.status) else f"the conic program ended with {found.status}"
    return (w if np.isfinite(w).all() else None), why


def _triangle(J: Array) -> Array:
    """Return the upper triangle of a symmetric matrix, columns stacked, off the diagonal times sqrt 2."""
    rows, columns = np.array([(i, j) for j in range(4) for i in range(j + 1)]).T
    return np.asarray(J[rows, columns] * np.where(rows == columns, 1.0, np.sqrt(2.0)))
