"""The ten numbers of a body in which its inertial forces are linear."""

import numpy as np

from ..spatial import Array, hat

#: Names of the ten numbers, in Pinocchio's order: mass, first moments, inertia about the frame's origin.
OF_BODY = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")
#: Row and column of the inertia's six numbers.
ROW, COLUMN = np.array([0, 0, 1, 0, 1, 2]), np.array([0, 1, 1, 2, 2, 2])
#: Which of the six each entry of the matrix is.
PLACE = np.array([[0, 1, 3], [1, 2, 4], [3, 4, 5]])

#: Part of the inertia about the origin that is rounding in that about the centre of mass: some ten roundings.
VANISHES = 2e-15


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

    A body without mass has its centre in the origin. What rounding leaves of an inertia that is zero is zero.
    """
    mass = float(ten[0])
    c = ten[1:4] / mass if mass else np.zeros(3)
    inertia = ten[4:][PLACE] - mass * (c @ c * np.eye(3) - np.outer(c, c))
    inertia[np.abs(inertia) <= VANISHES * np.trace(ten[4:][PLACE])] = 0.0
    return mass, c, inertia


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
