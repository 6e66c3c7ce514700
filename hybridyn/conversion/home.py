"""Compute the poses of links in the home posture, and positions of joints as single numbers."""

from __future__ import annotations

import math

import numpy as np

from ..description.placement import placement_from, rotation_from_quaternion
from ..description.records import Array, Description, Joint

#: Difference from a whole turn that is rounding in a file.
WHOLE = 1e-4


def home_of(d: Description, joint: Joint) -> tuple[float, ...]:
    """Return the home position of a joint: angles as one number, other coordinates as Pinocchio's.

    Args:
        d: The robot.
        joint: One of its joints, not fixed.
    """
    stated = d.home.get(joint.name)
    if joint.kind == "spherical":
        return stated or (0.0, 0.0, 0.0, 1.0)
    if joint.kind == "floating":
        return stated or (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    if joint.kind == "planar":
        x, y, c, s = stated or (0.0, 0.0, 1.0, 0.0)
        return x, y, math.atan2(s, c)
    if stated is not None and len(stated) == 2:
        return (_angle(d, joint.name),)
    return stated or (0.0,)


def _angle(d: Description, name: str) -> float:
    """Return the angle of a continuous joint at home, with the whole turns that a coupling needs."""
    angles = {}
    for joint, x in d.home.items():
        angles[joint] = math.atan2(x[1], x[0]) if len(x) == 2 else x[0]
    for coupling in d.couplings:
        if factor := dict(coupling.terms).get(name):
            left = coupling.offset - sum(c * angles.get(joint, 0.0) for joint, c in coupling.terms)
            turns = left / (2 * math.pi * factor)
            if abs(turns - round(turns)) < WHOLE:
                return angles[name] + 2 * math.pi * round(turns)
    return angles[name]


def motion_of(joint: Joint, at: tuple[float, ...]) -> Array:
    """Return the motion of a joint from position zero, shape (4, 4).

    Args:
        joint: The joint.
        at: Its position, as `home_of` returns it.
    """
    if joint.kind == "prismatic":
        return placement_from(np.eye(3), at[0] * joint.axis)
    if joint.kind == "spherical":
        return placement_from(rotation_from_quaternion(*at), np.zeros(3))
    if joint.kind == "floating":
        return placement_from(rotation_from_quaternion(*at[3:]), np.array(at[:3]))
    if joint.kind == "planar":
        return placement_from(_turn(joint.axis, at[2]), np.array([at[0], at[1], 0.0]))
    if joint.kind == "fixed":
        return np.eye(4)
    return placement_from(_turn(joint.axis, at[0]), np.zeros(3))


def home_poses(d: Description) -> dict[str, Array]:
    """Return the pose of each link in the root link in the home posture, shapes (4, 4).

    Args:
        d: The robot.
    """
    above = {joint.child: joint for joint in d.joints}
    poses = {d.root: np.eye(4)}
    for link in d.links:
        path = []
        name = link.name
        while name not in poses:
            path.append(above[name])
            name = above[name].parent
        for joint in reversed(path):
            at = home_of(d, joint) if joint.kind != "fixed" else ()
            poses[joint.child] = poses[joint.parent] @ joint.placement @ motion_of(joint, at)
    return poses


def _turn(axis: Array, angle: float) -> Array:
    x, y, z = math.sin(angle / 2) * axis
    return rotation_from_quaternion(float(x), float(y), float(z), math.cos(angle / 2))
