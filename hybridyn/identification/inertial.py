"""The ten numbers of a body in which its inertial forces are linear; and numbers of a body that can exist.

The standard parameters x minimise

    |S^-1 (K x - base)|^2 + |(x - prior) / (weight unit)|^2

with the estimate's covariance S S^T, K x = base, and the numbers of the robot's file as prior. If a body
would be impossible, a conic program finds the best x for which the pseudo-inertia of each body is positive
definite (Wensing, Kim & Slotine 2018) and no friction or rotor inertia is negative. Clarabel solves it: an
interior-point method with cones of matrices, in one small package without further dependencies, which takes
|A x - b| <= t as it stands, without forming A^T A.
"""

from collections.abc import Sequence

import numpy as np
from scipy import linalg, sparse

from ..errors import HybridynError, install_advice
from ..spatial import Array, Index, hat

#: Names of the ten numbers, in Pinocchio's order: mass, first moments, inertia about the frame's origin.
OF_BODY = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")
#: Row and column of the inertia's six numbers.
ROW, COLUMN = np.array([0, 0, 1, 0, 1, 2]), np.array([0, 1, 1, 2, 2, 2])
#: Which of the six each entry of the matrix is.
PLACE = np.array([[0, 1, 3], [1, 2, 4], [3, 4, 5]])
#: Least eigenvalue of a pseudo-inertia, of that of a body like the prior.
DEFINITE = 1e-4
#: Least standard deviation of an estimate that is believed, of the base parameter.
BELIEVED = 1e-7


def ten_numbers(mass: float, com: Array, inertia: Array) -> Array:
    """Compute the ten numbers of a body, shape (10,).

    Args:
        mass: Mass [kg].
        com: Centre of mass, shape (3,), [m].
        inertia: Inertia about the centre of mass, shape (3, 3), [kg m^2].
    """
    c = np.asarray(com, dtype=float)
    about_origin = (inertia + np.transpose(inertia)) / 2 + mass * (c @ c * np.eye(3) - np.outer(c, c))
    return np.concatenate([[mass], mass * c, about_origin[ROW, COLUMN]])


def mass_centre_inertia(ten: Array) -> tuple[float, Array, Array]:
    """Compute mass, centre of mass (3,) and inertia about it (3, 3) from the ten numbers.

    A body without mass has its centre in the origin.
    """
    mass = float(ten[0])
    c = ten[1:4] / mass if mass else np.zeros(3)
    return mass, c, ten[4:][PLACE] - mass * (c @ c * np.eye(3) - np.outer(c, c))


def moved(ten: Array, R: Array, p: Array) -> Array:
    """Express the ten numbers in a frame in which their own has the placement (R, p), shape (10,)."""
    mass, c, inertia = mass_centre_inertia(ten)
    if mass:
        return ten_numbers(mass, p + R @ c, R @ inertia @ R.T)
    out = ten_numbers(0.0, p, R @ inertia @ R.T)
    out[1:4] = R @ ten[1:4]
    return out


def wrench_matrix(acceleration: Array, w: Array, w_dot: Array) -> Array:
    """Compute the matrix W of the wrench W ten that moves a body, Eq. (30), about its frame's origin.

    Args:
        acceleration: Classical acceleration of the origin minus gravity, shape (..., 3), body axes.
        w: Angular velocity, shape (..., 3), body axes.
        w_dot: Angular acceleration, shape (..., 3), body axes.

    Returns:
        Shape (..., 6, 10): force, then moment.
    """
    out = np.zeros((*w.shape[:-1], 6, 10))
    spin = hat(w)
    out[..., :3, 0] = acceleration
    out[..., :3, 1:4] = hat(w_dot) + np.matmul(spin, spin)
    out[..., 3:, 1:4] = -hat(acceleration)
    out[..., 3:, 4:] = _times_inertia(w_dot) + np.matmul(spin, _times_inertia(w))
    return out


def _times_inertia(x: Array) -> Array:
    """Compute the matrix that turns the six numbers of an inertia I into I x, shape (..., 3, 6)."""
    return np.tensordot(x, np.eye(6)[PLACE], 1)


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


def consistent(
    combination: Array,
    base: Array,
    root: Array,
    prior: Array,
    unit: Array,
    bodies: Sequence[Index],
    positive: Sequence[int],
    *,
    weight: float = 1.0,
) -> tuple[Array, bool]:
    """Compute standard parameters that are physically possible and near an estimate.

    Args:
        combination: K, shape (rank, p).
        base: Estimated base parameters, shape (rank,).
        root: S with covariance S S^T, shape (rank, rank).
        prior: The numbers of the robot's file, shape (p,).
        unit: Size of each parameter, shape (p,); that of a parameter that is known exactly is zero.
        bodies: The ten parameters of each body.
        positive: Parameters that cannot be negative.
        weight: How far the file may be wrong, of `unit`.

    Returns:
        The parameters, shape (p,), and whether a constraint had to be kept by the conic program.

    Raises:
        HybridynError: clarabel is missing, or finds no solution.
    """
    size = np.maximum(np.abs(base), np.abs(combination) @ unit) + np.finfo(float).tiny
    U, spread, _ = linalg.svd(root / size[:, None])
    whiten = (U / np.maximum(spread, BELIEVED)).T / size
    steps = np.diag(unit)[:, unit > 0]  # x = prior + steps y, y the scaled differences of the free ones
    A = np.vstack([whiten @ combination @ steps, np.eye(steps.shape[1]) / weight])
    b = np.concatenate([whiten @ (base - combination @ prior), np.zeros(steps.shape[1])])
    x = prior + steps @ linalg.lstsq(A, b)[0]
    scales = [body_scale(prior[at]) for at in bodies]
    least = [np.linalg.eigvalsh(_seen(x[at], S))[0] for at, S in zip(bodies, scales, strict=True)]
    if (x[list(positive)] >= 0).all() and min(least, default=1.0) >= DEFINITE:
        return x, False
    return prior + steps @ _conic(A, b, prior, steps, bodies, scales, positive), True


def _seen(ten: Array, scale: Array) -> Array:
    """Return a pseudo-inertia relative to the prior one, which is the unit matrix, shape (4, 4)."""
    left = linalg.solve(scale, pseudo_inertia(ten))
    return np.asarray(linalg.solve(scale, left.T))


def _conic(
    A: Array,
    b: Array,
    start: Array,
    steps: Array,
    bodies: Sequence[Index],
    scales: Sequence[Array],
    positive: Sequence[int],
) -> Array:
    """Minimise |A y - b| over possible bodies, x = start + steps y; variables are a bound of it, and y."""
    try:
        import clarabel
    except ImportError:
        raise HybridynError(
            "some bodies would be impossible; finding the nearest ones needs clarabel: "
            f"{install_advice('identify')}"
        ) from None
    n = A.shape[1]
    least = DEFINITE * _triangle(np.eye(4))
    norm = np.append(0.0, -b), np.vstack([np.zeros(n), A]), clarabel.SecondOrderConeT(len(A) + 1)
    parts = [(np.eye(len(A) + 1, 1), *norm)]
    if len(positive):
        at = list(positive)
        parts.append((np.zeros((len(at), 1)), start[at], steps[at], clarabel.NonnegativeConeT(len(at))))
    for own, scale in zip(bodies, scales, strict=True):
        basis = np.array([_triangle(_seen(one, scale)) for one in np.eye(10)]).T
        cone = clarabel.PSDTriangleConeT(4)
        parts.append((np.zeros((10, 1)), basis @ start[own] - least, basis @ steps[own], cone))
    rows = -np.vstack([np.hstack([bound, matrix]) for bound, _, matrix, _ in parts])
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    found = clarabel.DefaultSolver(
        sparse.csc_matrix((n + 1, n + 1)), np.eye(1, n + 1)[0], sparse.csc_matrix(rows),
        np.concatenate([constant for _, constant, _, _ in parts]), [cone for *_, cone in parts], settings,
    ).solve()  # fmt: skip
    if "Solved" not in str(found.status):
        raise HybridynError(
            f"no robot that can exist was found ({found.status}): give the file's numbers another weight, or "
            "record a richer motion"
        )
    return np.asarray(found.x)[1:]


def _triangle(J: Array) -> Array:
    """Return the upper triangle of a symmetric matrix, columns stacked, off the diagonal times sqrt 2."""
    rows, columns = np.array([(i, j) for j in range(4) for i in range(j + 1)]).T
    return np.asarray(J[rows, columns] * np.where(rows == columns, 1.0, np.sqrt(2.0)))
