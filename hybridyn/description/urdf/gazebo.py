"""Read the SDF joints in `<gazebo>` that close loops of a URDF.

A joint there is SDF: `<parent>` and `<child>` name links, `<pose>` places the joint in the child's frame, and
the loop is closed where all joints are at zero, because SDF places its links in this posture.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..closure_forms import FORMS, closure_of
from ..names import did_you_mean, listed
from ..placement import poses_at_zero, relative, rotation_to_axis
from ..records import Array, RobotFile
from ..sdf.elements import direction, flag, pose
from .loops import kind_of
from .xml_node import Node

#: Types of SDF joints by the kind of closure.
TYPES = {
    "fixed": "fixed", "revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic",
    "ball": "spherical",
}  # fmt: skip
MODEL = "__model__"
CHILDREN = ("parent", "child", "pose", "axis", "physics", "sensor", "gearbox_ratio", "thread_pitch")


def read_gazebo_joints(root: Node, robot: RobotFile) -> None:
    """Add a closure for each SDF joint directly below a `<gazebo>` that concerns the whole robot.

    Raises:
        ModelError: A joint has a type that closes no loop here, or names what does not exist.
    """
    blocks = [block for block in root.children("gazebo") if "reference" not in block.attributes()]
    poses = poses_at_zero(robot.joints) | {MODEL: np.eye(4)}
    for node in (joint for block in blocks for joint in block.children("joint")):
        _read_joint(node, poses, robot)


def _read_joint(node: Node, poses: Mapping[str, Array], robot: RobotFile) -> None:
    kind = TYPES[kind_of(node, TYPES, "an SDF joint of type '{}' closes no loop here; write it as <loop>")]
    node.only(["name", "type"], CHILDREN)
    links = [_link(node.required_child(end), poses) for end in ("parent", "child")]
    at_child, at = node.child("pose"), poses[links[1]]
    if at_child is not None:
        at_child.only(["relative_to", "frame"], [])
        frame = at_child.xml.get("relative_to") or at_child.xml.get("frame") or links[1]
        at = _frame(at_child, frame, poses) @ pose(at_child)
    turn = np.eye(3)
    if FORMS[kind].has_axis:
        axis = node.required_child("axis")
        turn = rotation_to_axis(_direction(axis, at, poses))
        if unread := [tag for tag in ("dynamics", "limit") if axis.child(tag)]:
            robot.notes.append(
                f"closure '{node.text('name')}': {listed(unread)} of the SDF joint is not read"
            )
    sides = [(link, relative(poses[link], at)) for link in links]
    robot.closures.append(closure_of(node.text("name"), kind, sides, (turn, turn), line=node.line))


def _link(node: Node, poses: Mapping[str, Array]) -> str:
    """Return the link that an end of the joint names."""
    node.only([], [])
    name = node.content()
    if name == "world" and name not in poses:
        raise node.error(
            "a joint to the world closes no loop of the robot; name a link (the root link stands still on a "
            "fixed base)"
        )
    if name not in poses or name == MODEL:
        raise node.error(f"unknown link '{name}'{did_you_mean(name, poses)}")
    return name


def _direction(node: Node, at: Array, poses: Mapping[str, Array]) -> Array:
    """Return the unit axis in the joint's frame, shape (3,)."""
    xyz = node.child("xyz")
    value = np.array([0.0, 0.0, 1.0]) if xyz is None else direction(xyz)
    frame = "" if xyz is None else xyz.xml.get("expressed_in", "")
    if flag(node, "use_parent_model_frame"):
        frame = MODEL
    return at[:3, :3].T @ _frame(node, frame, poses)[:3, :3] @ value if frame else value


def _frame(node: Node, name: str, poses: Mapping[str, Array]) -> Array:
    if name not in poses:
        raise node.error(f"unknown frame '{name}'{did_you_mean(name, poses)}; name a link, or {MODEL}")
    return poses[name]
