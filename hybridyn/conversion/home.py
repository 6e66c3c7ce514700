"""Compute the poses of links in the home posture, and positions of joints as single numbers."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from ..description.placement import placement_from, rotation_from_quaternion
from ..description.records import Array, Description, Joint
from ..description.robot_file import ZERO
from ..description.zero_posture import outwards
from ..spatial import rotation_from_axis_angle


def home_of(d: Description, joint: Joint) -> tuple[float, ...]:
    """Return the home position of a joint: angles as one number, other coordinates as Pinocchio's.

    Args:
        joint: One of its joints, not fixed.
    """
    at = d.home.get(joint.name) or ZERO[joint.kind]
    if joint.kind == "planar":
        return (*at[:2], math.atan2(at[3], at[2]))
    return at if joint.kind in ("spherical", "floating") else (angle_of(at),)


def poses_at(
    d: Description, positions: Mapping[str, tuple[float, ...]], root: Array | None = None
) -> dict[str, Array]:
    """Return the pose of each link in a posture, shapes (4, 4); loops may be open.

    Args:
        positions: Joint positions by name, as in `Description.home`; zero for those left out.
        root: Pose of the root link, shape (4, 4); None for the identity.
    """
    poses = {d.root: np.eye(4) if root is None else root}
    for joint in outwards(d.joints, [d.root]):
        poses[joint.child] = poses[joint.parent] @ joint.placement @ motion_of(joint, positions)
    return poses


def motion_of(joint: Joint, positions: Mapping[str, tuple[float, ...]]) -> Array:
    """Return the motion of a joint from position zero, shape (4, 4)."""
    at = positions.get(joint.name)
    if at is None or joint.kind == "fixed":
        return np.eye(4)
    if joint.kind == "prismatic":
        return placement_from(np.eye(3), joint.axis * at[0])
    if joint.kind == "spherical":
        return placement_from(rotation_from_quaternion(*at), np.zeros(3))
    if joint.kind == "floating":
        return free_pose(at)
    if joint.kind == "planar":
        return placement_from(turn_about(joint.axis, math.atan2(at[3], at[2])), np.array([at[0], at[1], 0.0]))
    return placement_from(turn_about(joint.axis, angle_of(at)), np.zeros(3))


def angle_of(at: tuple[float, ...]) -> float:
    """Return the position of a joint with one freedom [m or rad], also from cosine and sine."""
    return math.atan2(at[1], at[0]) if len(at) == 2 else float(at[0])


def free_pose(at: tuple[float, ...]) -> Array:
    """Return the pose of a free body from position [m] and quaternion x, y, z, w, shape (4, 4)."""
    return placement_from(rotation_from_quaternion(*at[3:7]), np.array(at[:3]))


def turn_about(axis: Array, angle: float) -> Array:
    """Return the rotation about a unit axis (3,) by an angle [rad], shape (3, 3)."""
    return rotation_from_axis_angle(axis, np.cos(angle), np.sin(angle))
