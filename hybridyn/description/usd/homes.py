"""The home posture of a USD robot: joint states, else the positions that the bodies' transforms give."""

from __future__ import annotations

import numpy as np

from ...spatial import quaternion_from_rotation, rotation_from_axis_angle
from ..names import listed
from ..placement import inverse
from ..records import Array
from ..robot_file import RobotFile
from .joints import UsdJoint, direction, instance, unit_of
from .schema import AXES
from .stage import Stage

#: Positions below this [rad, or of the robot's size] are single-precision rounding of transforms.
TRANSFORM_ROUNDING = 1e-6

#: Deviation [rad, or of the robot's size] above which bodies do not stand where their joint allows.
OFF_AXIS = 1e-3


def add_home(robot: RobotFile, stage: Stage, joints: list[tuple[UsdJoint, bool]]) -> None:
    """Add the home posture to the robot; positions of zero are left out.

    Args:
        robot: The robot.
        stage: Its stage.
        joints: The joints of the tree, each with whether its second body is the child.
    """
    poses = {path: prim.pose for path, prim in stage.moving.items()}
    placements = [*poses.values(), *(frame for joint, _ in joints for frame in joint.frames)]
    size = max((float(np.abs(place[:3, 3]).max()) for place in placements), default=0.0) or 1.0
    off = []
    for joint, forward in joints:
        first, second = (
            poses.get(end, np.eye(4)) @ frame for end, frame in zip(joint.ends, joint.frames, strict=True)
        )
        found = inverse(first) @ second
        positions, motion = _moved(joint, found)
        deviation = np.abs(found - motion)
        if max(deviation[:3, 3].max() / size, deviation[:3, :3].max()) > OFF_AXIS:
            off.append(joint.prim.path)
        for axis, position in positions.items():
            state, unit = f"state:{instance(joint.prim, axis)}:physics:position", unit_of(joint.prim, axis)
            zero = TRANSFORM_ROUNDING * (1.0 if axis.startswith("rot") else size)
            value = joint.prim.number(state, 0.0) * unit or (position if abs(position) > zero else 0.0)
            if value:
                robot.home[joint.names[axis]] = (value,)
        if "ball" in joint.names and (turn := _ball_coordinates(joint, forward, found)):
            robot.home[joint.names["ball"]] = turn
    if off:
        robot.notes.append(
            f"joints {listed(off)} do not allow the poses of their bodies; home is the nearest posture"
        )


def _moved(joint: UsdJoint, found: Array) -> tuple[dict[str, float], Array]:
    """Return the positions nearest to a motion of a joint, and its motion there.

    Args:
        joint: The joint.
        found: Its second frame in the first, shape (4, 4).

    Returns:
        Positions along the axes with one freedom [m or rad], and the second frame in the first, shape (4, 4).
    """
    positions, motion = {}, np.eye(4)
    for axis in joint.chain:
        i = AXES.index(axis) % 3 if axis != "ball" else 0
        j, k = (i + 1) % 3, (i + 2) % 3
        if axis == "ball":
            motion[:3, :3] = found[:3, :3]
        elif axis.startswith("trans"):
            positions[axis] = motion[i, 3] = float(found[i, 3])
        else:
            sine, cosine = found[k, j] - found[j, k], found[j, j] + found[k, k]
            positions[axis] = angle = float(np.arctan2(sine, cosine))
            motion[:3, :3] = rotation_from_axis_angle(direction(axis), np.cos(angle), np.sin(angle))
    return positions, motion


def _ball_coordinates(joint: UsdJoint, forward: bool, found: Array) -> tuple[float, ...]:
    """Return the quaternion x, y, z, w of a ball joint, empty for zero.

    The joint turns about the child's axes where its frame has the child's origin, else about its frame's.
    """
    moved, far = (found, joint.frames[1]) if forward else (inverse(found), joint.frames[0])
    ends_in_child = not far[:3, 3].any() and (forward or len(joint.chain) == 1)
    turn = far[:3, :3] if ends_in_child else np.eye(3)
    seen = turn @ moved[:3, :3] @ turn.T
    if np.abs(seen - np.eye(3)).max() <= TRANSFORM_ROUNDING:
        return ()
    return tuple(float(x) for x in quaternion_from_rotation(seen))
