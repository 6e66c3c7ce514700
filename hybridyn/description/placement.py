"""Build rotation matrices, and placements: 4 x 4 matrices of a rotation and a position."""

from __future__ import annotations

import numpy as np

from .records import Array


def rotation_from_rpy(roll: float, pitch: float, yaw: float) -> Array:
    """Compute Rz(yaw) Ry(pitch) Rx(roll), shape (3, 3), from URDF's fixed-axis angles [rad]."""
    (cr, cp, cy), (sr, sp, sy) = np.cos([roll, pitch, yaw]), np.sin([roll, pitch, yaw])
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def rotation_from_quaternion(x: float, y: float, z: float, w: float) -> Array:
    """Compute the rotation matrix of a unit quaternion, shape (3, 3)."""
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def rotation_to_axis(axis: Array) -> Array:
    """Compute a rotation matrix that maps z to a unit axis, shape (3, 3); exact for the coordinate axes.

    The rotation about the axis itself is arbitrary: x, y and z give cyclic permutations of the axes.
    """
    helper = np.eye(3)[(int(np.argmax(np.abs(axis))) + 1) % 3]
    x = helper - axis * (axis @ helper)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(axis, x), axis])


def placement_from(rotation: Array, position: Array) -> Array:
    """Return the homogeneous matrix of a rotation (3, 3) and a position (3,) [m], shape (4, 4)."""
    placement = np.eye(4)
    placement[:3, :3], placement[:3, 3] = rotation, position
    return placement


def turned(placement: Array, rotation: Array) -> Array:
    """Return a frame with the same origin, rotated by `rotation` about its own axes, shape (4, 4)."""
    return placement_from(placement[:3, :3] @ rotation, placement[:3, 3])


def inverse(placement: Array) -> Array:
    """Return the inverse of a placement, shape (4, 4)."""
    return placement_from(placement[:3, :3].T, -placement[:3, :3].T @ placement[:3, 3])
