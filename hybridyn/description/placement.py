"""Build rotations and placements (4 x 4 matrices of a rotation and a position); pose all links."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping

import numpy as np

from ..spatial import rotation_from_axis_angle
from .records import Array, Description, Joint


def rotation_from_rpy(roll: float, pitch: float, yaw: float) -> Array:
    """Compute Rz(yaw) Ry(pitch) Rx(roll), shape (3, 3), from URDF's fixed-axis angles [rad]."""
    angles = np.array([roll, pitch, yaw])
    (cr, cp, cy), (sr, sp, sy) = np.cos(angles).tolist(), np.sin(angles).tolist()
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


#: The rotation by no angle.
UNTURNED = rotation_from_rpy(0.0, 0.0, 0.0)


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
    placement = np.zeros((4, 4))
    placement[:3, :3], placement[:3, 3], placement[3, 3] = rotation, position, 1.0
    return placement


def turned(placement: Array, rotation: Array) -> Array:
    """Return a frame with the same origin, rotated by `rotation` about its own axes, shape (4, 4)."""
    return placement_from(placement[:3, :3] @ rotation, placement[:3, 3])


def inverse(placement: Array) -> Array:
    """Return the inverse of a placement, shape (4, 4)."""
    return placement_from(placement[:3, :3].T, -placement[:3, :3].T @ placement[:3, 3])


def poses_at_zero(joints: Iterable[Joint]) -> dict[str, Array]:
    """Compute the frame of every link in the frame of its root, all joints at zero.

    The joints need not form a tree yet: links of a cycle are left out, and a link with two parents takes the
    first.

    Returns:
        Placements by link name, each of shape (4, 4).
    """
    every = list(joints)
    children = {joint.child for joint in every}
    out = {joint.parent: np.eye(4) for joint in every if joint.parent not in children}
    for joint in outwards(every, list(out)):
        out.setdefault(joint.child, out[joint.parent] @ joint.placement)
    return out


def poses_at(
    d: Description, positions: Mapping[str, tuple[float, ...]], root: Array | None = None
) -> dict[str, Array]:
    """Return the pose of each link in a posture, shapes (4, 4).

    Args:
        positions: Joint positions by name, as in `Description.home`; zero for those left out.
        root: Pose of the root link, shape (4, 4); None for the identity.
    """
    poses = {d.root: np.eye(4) if root is None else root}
    for joint in outwards(d.joints, [d.root]):
        poses[joint.child] = poses[joint.parent] @ joint.placement @ motion_of(joint, positions)
    return poses


def outwards(joints: Iterable[Joint], roots: list[str]) -> Iterator[Joint]:
    """Yield the joints from the roots outwards, each after the joint that carries it."""
    below: dict[str, list[Joint]] = {}
    for joint in joints:
        below.setdefault(joint.parent, []).append(joint)
    waiting = list(roots)
    while waiting:
        for joint in below.pop(waiting.pop(), ()):
            yield joint
            waiting.append(joint.child)


def motion_of(joint: Joint, positions: Mapping[str, tuple[float, ...]]) -> Array:
    """Return the motion of a joint from position zero, shape (4, 4)."""
    at = positions.get(joint.name)
    if at is None or joint.kind == "fixed":
        return np.eye(4)
    n, place = joint.kind.shift, np.zeros(3)
    turn = at[n:]
    if joint.kind.slides:
        place = joint.axis * at[0]
    elif joint.kind.single:
        place = joint.axis * (joint.pitch * angle_of(turn))
    else:
        place[:n] = at[:n]
    return placement_from(_turn_of(joint, turn), place)


def _turn_of(joint: Joint, at: tuple[float, ...]) -> Array:
    """Return the rotation by the coordinates of a joint behind its shift, shape (3, 3)."""
    if not at:
        return np.eye(3)
    if joint.kind.ball:
        return rotation_from_quaternion(*at)
    angle = angle_of(at)
    return rotation_from_axis_angle(joint.axis, np.cos(angle), np.sin(angle))


def angle_of(at: tuple[float, ...]) -> float:
    """Return the position of a joint with one freedom [m or rad], also from cosine and sine."""
    return math.atan2(at[1], at[0]) if len(at) == 2 else float(at[0])


def free_pose(at: tuple[float, ...]) -> Array:
    """Return the pose of a free body from position [m] and quaternion x, y, z, w, shape (4, 4)."""
    return placement_from(rotation_from_quaternion(*at[3:7]), np.array(at[:3]))


def relative(pose_a: Array, pose_b: Array) -> Array:
    """Compute the placement of frame B in frame A from both poses, shape (4, 4)."""
    rotation = pose_a[:3, :3].T
    return placement_from(rotation @ pose_b[:3, :3], rotation @ (pose_b[:3, 3] - pose_a[:3, 3]))
