"""Roll, pitch and yaw of rotations, URDF's R = Rz(yaw) Ry(pitch) Rx(roll), and their rates.

Every rotation has two triples of angles: (roll, pitch, yaw) and (roll + pi, pi - pitch, yaw + pi). The pitch
of the *upright* one is within a quarter turn. A *heading*, a yaw nearby, tells which of the two is meant.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..spatial import Array, compose, cross, rotation_from_axis_angle

#: Least cosine of the pitch at which a rotation tells its yaw; below it the heading is the yaw.
LOCK = 1e-9
#: Least cosine of the pitch in divisions, so that rates of roll and yaw stay finite.
STEEP = 1e-8


def rotation_from_angles(angles: Array) -> Array:
    """Build rotations, shape (..., 3, 3), from roll, pitch and yaw, shape (..., 3), [rad]."""
    roll, pitch, yaw = (
        rotation_from_axis_angle(axis, np.cos(angles[..., i]), np.sin(angles[..., i]))
        for i, axis in enumerate(np.eye(3))
    )
    return compose(compose(yaw, pitch), roll)


def other_triple(angles: Array) -> Array:
    """Return the other roll, pitch and yaw of the same rotations, shape (..., 3), [rad]."""
    out: Array = np.array([np.pi, np.pi, np.pi]) + angles * np.array([1.0, -1.0, 1.0])
    return out


def wrapped(angles: Array) -> Array:
    """Return angles less whole turns, within half a turn."""
    out: Array = angles - 2 * np.pi * np.round(angles / (2 * np.pi))
    return out


def angles_of(R: Array, heading: Array | None = None) -> Array:
    """Compute roll, pitch and yaw of rotations, shape (..., 3), [rad].

    Args:
        R: Rotations, shape (..., 3, 3).
        heading: A yaw near that of the triple that is meant, shape (...,), [rad]; None for the upright one.
            Where the pitch is a quarter turn, it is the yaw.
    """
    near = np.zeros(R.shape[:-2]) if heading is None else heading
    cosine = np.hypot(R[..., 0, 0], R[..., 1, 0])
    yaw = np.where(cosine > LOCK, np.arctan2(R[..., 1, 0], R[..., 0, 0]), near)
    if heading is not None:
        yaw = yaw + np.pi * (np.cos(yaw - near) < 0.0)
    c, s = np.cos(yaw), np.sin(yaw)
    # Rz(yaw)^T R = Ry(pitch) Rx(roll): its first column is (cos(pitch), 0, -sin(pitch)), its second row
    # (0, cos(roll), -sin(roll)).
    pitch = np.arctan2(-R[..., 2, 0], c * R[..., 0, 0] + s * R[..., 1, 0])
    roll = np.arctan2(s * R[..., 0, 2] - c * R[..., 1, 2], c * R[..., 1, 1] - s * R[..., 0, 1])
    return np.stack([roll, pitch, wrapped(yaw)], -1)


def plain_heading(R: Array) -> Array:
    """Return the yaw of the plainer triple of rotations: of the smaller sum of sizes, shape (...,), [rad]."""
    upright = angles_of(R)
    other = wrapped(other_triple(upright))
    plainer = np.abs(upright).sum(axis=-1) <= np.abs(other).sum(axis=-1)
    out: Array = np.where(plainer, upright[..., 2], other[..., 2])
    return out


def headings_along(R: Array, before: float) -> Array:
    """Return the yaws along a motion, each of the triple nearest to the one before, shape (T,), [rad].

    Args:
        R: Rotations at consecutive samples, shape (T, 3, 3).
        before: Heading before the first sample [rad].
    """
    told = np.concatenate([[True], np.hypot(R[:, 0, 0], R[:, 1, 0]) > LOCK])
    last = np.maximum.accumulate(np.where(told, np.arange(len(told)), 0))
    yaw = np.concatenate([[before], np.arctan2(R[:, 1, 0], R[:, 0, 0])])[last]
    out: Array = np.unwrap(yaw, period=np.pi)[1:]
    return out


def angular_map(R: Array, angles: Array) -> Array:
    """Compute the map from rates of roll, pitch, yaw to angular velocity, shape (T, 3, 3).

    Its columns are the axes of the three turns: of the body, of the line of nodes, and of the reference.

    Args:
        R: Rotations, shape (T, 3, 3).
        angles: Their roll, pitch and yaw, shape (T, 3), [rad].
    """
    E = np.zeros_like(R)
    E[:, :, 0], E[:, 2, 2] = R[:, :, 0], 1.0
    E[:, 0, 1], E[:, 1, 1] = -np.sin(angles[:, 2]), np.cos(angles[:, 2])
    return E


def rate_map(angles: Array) -> Array:
    """Compute the map from angular velocity to rates of roll, pitch, yaw, shape (T, 3, 3).

    Near a pitch of a quarter turn, the rates of roll and yaw grow without bound; that of pitch does not.

    Args:
        angles: Roll, pitch and yaw, shape (T, 3), [rad].
    """
    yaw, cosine = angles[:, 2], np.cos(angles[:, 1])
    steep = np.copysign(np.maximum(np.abs(cosine), STEEP), cosine)
    return turn_rates((np.cos(yaw), np.sin(yaw)), (steep, np.sin(angles[:, 1])))


def turn_rates(yaw: tuple[Any, Any], pitch: tuple[Any, Any]) -> Array:
    """Compute `rate_map` from cosines and sines of yaw and pitch, numbers (T,) or symbols, (..., 3, 3)."""
    (c, s), (cosine, sine), zero = yaw, pitch, 0.0 * pitch[0]
    along, across = c / cosine, s / cosine
    rows = [along, across, zero], [-s, c, zero], [sine * along, sine * across, zero + 1.0]
    return np.stack([np.stack([np.asarray(x) for x in row], axis=-1) for row in rows], axis=-2)


def angular_drift(E: Array, rates: Array) -> Array:
    """Compute the angular acceleration at constant rates of roll, pitch and yaw, shape (T, 3).

    Args:
        E: Map of `angular_map`, shape (T, 3, 3).
        rates: Rates of roll, pitch and yaw, shape (T, 3), [rad/s].
    """
    roll, pitch, yaw = (E[:, :, i] * rates[:, i, None] for i in range(3))
    # The line of nodes turns with yaw, the body's axis with pitch, too.
    return cross(yaw, roll + pitch) + cross(pitch, roll)
