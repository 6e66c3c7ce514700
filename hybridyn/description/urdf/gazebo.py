"""Read the SDF joints in `<gazebo>` that close loops of a URDF.

A joint there is SDF: `<parent>` and `<child>` name links, `<pose>` places the joint in the child's frame, and
the loop is closed where all joints are at zero, because SDF places its links in this posture.
"""

from __future__ import annotations

import numpy as np

from ..closure_forms import FORMS, LARGEST_COSINE
from ..names import did_you_mean, listed
from ..placement import placement_from, poses_at_zero, relative, rotation_from_rpy, rotation_to_axis, turned
from ..records import Array, Closure
from ..robot_file import RobotFile
from .placement import SMALLEST_AXIS
from .xml_node import Node

#: Types of SDF joints by the kind of closure.
TYPES = {
    "fixed": "fixed", "revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic",
    "ball": "spherical", "universal": "universal", "revolute2": "universal",
}  # fmt: skip
MODEL = "__model__"
CHILDREN = ("parent", "child", "pose", "axis", "axis2", "physics", "sensor", "gearbox_ratio", "thread_pitch")


def gazebo_joints(root: Node) -> list[Node]:
    """Return the joints directly below a `<gazebo>` that concerns the whole robot."""
    blocks = [block for block in root.children("gazebo") if "reference" not in block.attributes()]
    return [joint for block in blocks for joint in block.children("joint")]


def read_gazebo_joints(root: Node, robot: RobotFile) -> None:
    """Add a closure for each SDF joint below `<gazebo>`.

    Raises:
        ModelError: A joint has a type that closes no loop here, or names what does not exist.
    """
    nodes = gazebo_joints(root)
    if not nodes:
        return
    poses = poses_at_zero(robot.joints)
    for node in nodes:
        robot.closures.append(_closure(node, poses, robot.notes))


def _closure(node: Node, poses: dict[str, Array], notes: list[str]) -> Closure:
    node.only(["name", "type"], CHILDREN)
    stated, name = node.text("type"), node.text("name")
    if stated not in TYPES:
        raise node.error(
            f"an SDF joint of type '{stated}' closes no loop here{did_you_mean(stated, TYPES)}; known: "
            f"{listed(TYPES)}"
        )
    kind = TYPES[stated]
    form = FORMS[kind]
    parent, child = (_link(node.required_child(end), poses) for end in ("parent", "child"))
    at = _placed(node.child("pose"), child, poses)
    frame_a, frame_b = relative(poses[parent], at), relative(poses[child], at)
    turns = [np.eye(3), np.eye(3)]
    if form.has_axis:
        axis = node.required_child("axis")
        second = node.required_child("axis2") if kind == "universal" else axis
        directions = [_direction(one, at, poses) for one in (axis, second)]
        if kind == "universal":
            _check_perpendicular(node, stated, directions)
        turns = [rotation_to_axis(direction) for direction in directions]
        unread = {tag for one in (axis, second) for tag in ("limit", "dynamics") if one.child(tag)}
        if unread:
            notes.append(f"closure '{name}': {listed(sorted(unread))} of the SDF joint is not read")
    return Closure(
        name, kind, parent, turned(frame_a, turns[0]), child, turned(frame_b, turns[1]), form.translations,
        form.rotation, node.line, turns[0],
    )  # fmt: skip


def _check_perpendicular(node: Node, stated: str, directions: list[Array]) -> None:
    cosine = float(np.clip(directions[0] @ directions[1], -1, 1))
    if abs(cosine) > LARGEST_COSINE:
        raise node.error(
            f"the axes of this {stated} joint stand at {np.degrees(np.arccos(cosine)):.4g} degrees; a "
            "closure of two axes needs 90 degrees: mend the axes, or add a link between two revolute joints"
        )


def _link(node: Node, poses: dict[str, Array]) -> str:
    """Return the link that an end of the joint names."""
    node.only([], [])
    name = (node.xml.text or "").strip()
    if name == "world" and name not in poses:
        raise node.error(
            "a joint to the world closes no loop of the robot; name a link (the root link stands still on a "
            "fixed base)"
        )
    if name not in poses:
        raise node.error(f"unknown link '{name}'{did_you_mean(name, poses)}")
    return name


def _placed(node: Node | None, child: str, poses: dict[str, Array]) -> Array:
    """Return the pose of the joint's frame in the root's frame, shape (4, 4)."""
    if node is None:
        return poses[child]
    node.only(["relative_to", "frame"], [])
    x, y, z, *angles = node.content_numbers(6)
    stated = node.xml.get("relative_to") or node.xml.get("frame") or child
    own = placement_from(rotation_from_rpy(*angles), np.array([x, y, z]))
    return _frame(node, stated, poses) @ own


def _direction(node: Node, at: Array, poses: dict[str, Array]) -> Array:
    """Return the unit axis in the joint's frame, shape (3,)."""
    xyz = node.child("xyz")
    flag = node.child("use_parent_model_frame")
    value = np.array([0.0, 0.0, 1.0]) if xyz is None else xyz.content_numbers(3)
    length = float(np.linalg.norm(value))
    if length < SMALLEST_AXIS:
        raise node.error("the axis is zero; give a direction such as <xyz>0 0 1</xyz>")
    stated = "" if xyz is None else xyz.xml.get("expressed_in", "")
    if flag is not None and (flag.xml.text or "").strip() in ("1", "true"):
        stated = MODEL
    unit: Array = value / length
    if not stated:
        return unit
    return at[:3, :3].T @ _frame(node, stated, poses)[:3, :3] @ unit


def _frame(node: Node, name: str, poses: dict[str, Array]) -> Array:
    if name == MODEL:
        return np.eye(4)
    if name not in poses:
        raise node.error(f"unknown frame '{name}'{did_you_mean(name, poses)}; name a link, or {MODEL}")
    return poses[name]
