"""Where the links of a robot stand at home, without closing its loops."""

from __future__ import annotations

import numpy as np

from ...description.placement import placement_from, rotation_from_quaternion
from ...description.records import Array, Description, Joint


def home_poses(d: Description) -> dict[str, Array]:
    """Return the placement of each link in the world at home, shape (4, 4).

    Args:
        d: The robot.
    """
    base = np.eye(4) if d.base_home is None or d.base != "floating" else _free(d.base_home)
    out, waiting = {d.root: base}, [d.root]
    below: dict[str, list[Joint]] = {}
    for joint in d.joints:
        below.setdefault(joint.parent, []).append(joint)
    while waiting:
        for joint in below.get(waiting.pop(), ()):
            out[joint.child] = out[joint.parent] @ joint.placement @ motion(joint, d.home.get(joint.name))
            waiting.append(joint.child)
    return out


def motion(joint: Joint, q: tuple[float, ...] | None) -> Array:
    """Return the motion of a joint from position zero, shape (4, 4).

    Args:
        joint: The joint.
        q: Its position as in `Description.home`, None for zero.
    """
    if q is None:
        return np.eye(4)
    if joint.kind == "prismatic":
        return placement_from(np.eye(3), joint.axis * q[0])
    if joint.kind == "spherical":
        return placement_from(rotation_from_quaternion(*q), np.zeros(3))
    if joint.kind == "floating":
        return _free(q)
    if joint.kind == "planar":
        half = np.arctan2(q[3], q[2]) / 2
        turn = rotation_from_quaternion(0.0, 0.0, float(np.sin(half)), float(np.cos(half)))
        return placement_from(turn, np.array([q[0], q[1], 0.0]))
    half = angle_of(q) / 2
    x, y, z = (float(part) for part in np.sin(half) * joint.axis)
    return placement_from(rotation_from_quaternion(x, y, z, float(np.cos(half))), np.zeros(3))


def angle_of(q: tuple[float, ...]) -> float:
    """Return the position of a joint with one freedom [m or rad], also from cosine and sine."""
    return float(np.arctan2(q[1], q[0])) if len(q) == 2 else float(q[0])


def _free(q: tuple[float, ...]) -> Array:
    return placement_from(rotation_from_quaternion(*q[3:7]), np.array(q[:3]))
