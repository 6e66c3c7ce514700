"""From the coordinates of a table to those of the spanning tree, and back."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..description.records import Array, Joint
from ..joints.kinds import JointKind
from ..spatial import cross, rotate, rotate_back, rotation_from_quaternion
from .signals import on_circles
from .trajectory import TableMotion, Triple


def full_state(motion: TableMotion, joints: Sequence[Joint], root: str | None = None) -> Triple:
    """Return the state on the spanning tree from a motion that names every joint.

    Args:
        joints: The movable joints, in the order of q.
        root: Name of the root link, whose pose comes first, where the base moves; else None.

    Returns:
        q, v and a, shapes (T, nq), (T, nv), (T, nv), in Pinocchio's coordinates.
    """
    parts = []
    if root is not None:
        pose, twist, acceleration = map(np.asarray, motion.platforms[root])  # whole, never by coordinates
        parts.append(_base_coordinates(pose, twist, acceleration))
    parts += [_joint_coordinates(joint.kind, *motion.joints[joint.name]) for joint in joints]
    q, v, a = (np.hstack(level) for level in zip(*parts, strict=True))
    return q, v, a


def _joint_coordinates(kind: JointKind, position: Array, velocity: Array, acceleration: Array) -> Triple:
    p, v, a = (level.reshape(len(level), -1) for level in (position, velocity, acceleration))
    if kind.ball:
        p = np.hstack([p[:, :-4], p[:, -4:] / np.linalg.norm(p[:, -4:], axis=1, keepdims=True)])
    return on_circles(kind, p), v, a


def _base_coordinates(pose: Array, twist: Array, acceleration: Array) -> Triple:
    """Convert a pose with twist and classical acceleration in world axes to a free-flyer's coordinates."""
    R = rotation_from_quaternion(pose[:, 3:])
    v, omega = rotate_back(R, twist[:, :3]), rotate_back(R, twist[:, 3:])
    linear = rotate_back(R, acceleration[:, :3]) - cross(omega, v)
    return pose, np.hstack([v, omega]), np.hstack([linear, rotate_back(R, acceleration[:, 3:])])


def base_acceleration(q: Array, v: Array, a: Array) -> Array:
    """Compute a free-flyer's acceleration as stored in tables: classical and angular, in world axes.

    Args:
        q: Positions, the free-flyer's first, shape (T, nq).
        v: Rates, shape (T, nv).
        a: Accelerations in Pinocchio's coordinates, shape (T, nv).

    Returns:
        Shape (T, 6), [m/s^2, rad/s^2].
    """
    R = rotation_from_quaternion(q[:, 3:7])
    classical = a[:, :3] + cross(v[:, 3:6], v[:, :3])
    return np.hstack([rotate(R, classical), rotate(R, a[:, 3:6])])
