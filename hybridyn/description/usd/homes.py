"""The home posture of a USD robot: joint states, else the positions that the bodies' transforms give."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..joint_graph import pose_coordinates
from ..names import listed
from ..placement import inverse, placement_from, rotation_from_quaternion
from ..records import Array
from ..robot_file import RobotFile
from .bodies import Bodies
from .joints import UsdJoint, direction, relative, unit_of

#: Positions below this [rad, or of the robot's size] are single-precision rounding of transforms.
TRANSFORM_ROUNDING = 1e-6

#: Deviation [rad, or of the robot's size] above which bodies do not stand where their joint allows.
OFF_AXIS = 1e-3


def add_home(
    robot: RobotFile,
    bodies: Bodies,
    joints: list[tuple[UsdJoint, bool]],
    names: Mapping[str, Mapping[str, str]],
) -> None:
    """Add the home posture to the robot; positions of zero are left out.

    Args:
        joints: The joints of the tree, each with whether its second body is the child.
        names: Names of their records by path and axis.
    """
    size = _size(bodies, joints)
    off = []
    for joint, forward in joints:
        found = relative(bodies, joint)
        positions = _positions(joint, found)
        if _deviation(joint, found, positions, size) > OFF_AXIS:
            off.append(joint.prim.path)
        for axis, name in names[joint.prim.path].items():
            value = _stated(joint, axis)
            if value is None:
                value = _placed(axis, positions, size)
            if axis == "ball":
                value = _ball_coordinates(joint, forward, found)
            if value is not None:
                robot.home[name] = value
    if off:
        robot.notes.append(
            f"joints {listed(off)} do not allow the poses of their bodies; home is the nearest posture"
        )


def _size(bodies: Bodies, joints: list[tuple[UsdJoint, bool]]) -> float:
    """Return the largest offset of the robot [m], 1 if there is none."""
    offsets = [frame[:3, 3] for joint, _ in joints for frame in joint.frames]
    offsets += [bodies.pose(prim).frame[:3, 3] for prim in bodies.moving.values()]
    return max((float(np.abs(offset).max()) for offset in offsets), default=0.0) or 1.0


def _positions(joint: UsdJoint, found: Array) -> dict[str, float]:
    """Return the positions along the one-freedom axes of a joint [m or rad]."""
    out: dict[str, float] = {}
    turning = [axis for axis in joint.free if axis.startswith("rot")]
    for axis in joint.free:
        if axis.startswith("trans"):
            out[axis] = float(found["XYZ".index(axis[-1]), 3])
        elif len(turning) == 1:
            i = "XYZ".index(axis[-1])
            j, k = (i + 1) % 3, (i + 2) % 3
            out[axis] = float(np.arctan2(found[k, j] - found[j, k], found[j, j] + found[k, k]))
    return out


def _deviation(joint: UsdJoint, found: Array, positions: dict[str, float], size: float) -> float:
    """Return how far a joint is from every position that it can take, in radians and sizes of the robot."""
    held = np.array(
        [found[i, 3] for i, axis in enumerate(("transX", "transY", "transZ")) if axis not in joint.free]
    )
    far = float(np.abs(held).max()) / size if held.size else 0.0
    turning = [axis for axis in joint.free if axis.startswith("rot")]
    if len(turning) < 3:
        turn = np.eye(3)
        for axis in turning:
            half = positions[axis] / 2 if axis in positions else 0.0
            x, y, z = np.sin(half) * direction(axis)
            turn = turn @ rotation_from_quaternion(x, y, z, np.cos(half))
        far = max(far, float(np.abs(found[:3, :3] - turn).max()))
    return far


def _stated(joint: UsdJoint, axis: str) -> tuple[float, ...] | None:
    """Return the position that the file states as the state of a joint [m or rad]."""
    name = f"state:{joint.instance(axis)}:physics:position"
    if axis not in joint.free or not joint.prim.states(name):
        return None
    value = joint.prim.number(name, 0.0) * unit_of(joint.prim, axis)
    return (value,) if value else None


def _placed(axis: str, positions: dict[str, float], size: float) -> tuple[float, ...] | None:
    """Return the position that the transforms of the bodies give, None for zero."""
    zero = TRANSFORM_ROUNDING * (1.0 if axis.startswith("rot") else size)
    value = positions.get(axis, 0.0)
    return (value,) if abs(value) > zero else None


def _ball_coordinates(joint: UsdJoint, forward: bool, found: Array) -> tuple[float, ...] | None:
    """Return the quaternion x, y, z, w of a ball joint, None for zero.

    The joint turns about the child's axes where its frame has the child's origin, else about its frame's.
    """
    moved, far = (found, joint.frames[1]) if forward else (inverse(found), joint.frames[0])
    ends_in_child = not far[:3, 3].any() and (forward or len(joint.chain()) == 1)
    turn = far[:3, :3] if ends_in_child else np.eye(3)
    seen = turn @ moved[:3, :3] @ turn.T
    if np.abs(seen - np.eye(3)).max() <= TRANSFORM_ROUNDING:
        return None
    return pose_coordinates(placement_from(seen, np.zeros(3)))[3:]
