"""Joints of MJCF files that `hybridyn convert` wrote as several joints, or about the axes of another frame.

MuJoCo has no planar joint, free joints on the world only, and turns ball joints about the axes of their body.
A text in `<custom>` names such a joint, its kind, and the quaternion (w, x, y, z) of its frame in the body:

    <custom><text name="hybridyn joint:table" data="planar 1 0 0 0"/></custom>

A planar joint stands as slides `table_x`, `table_y` and a hinge `table_turn`, a floating one as three slides
and a ball `table_turn`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...errors import ModelError
from ..names import did_you_mean
from ..placement import inverse, placement_from, rotation_from_quaternion
from ..records import Array, Joint, JointKind, Link
from ..robot_file import RobotFile
from ..urdf.xml_node import Node
from .naming import unique

#: What the name of a text starts with, before the joint's name.
JOINT = "hybridyn joint:"
#: Endings of the joints that stand for a joint, by its kind.
PARTS: dict[JointKind, tuple[str, ...]] = {
    "spherical": ("",),
    "planar": ("_x", "_y", "_turn"),
    "floating": ("_x", "_y", "_z", "_turn"),
}


def read_joint_mark(node: Node) -> tuple[JointKind, Array]:
    """Return kind and frame of a joint, shape (4, 4), as a text states them.

    Raises:
        ModelError: It states no kind, or no quaternion.
    """
    word, *numbers = str(node.xml.get("data", "")).split() or [""]
    kind = next((kind for kind in PARTS if kind == word), None)
    try:
        w, x, y, z = (float(number) for number in numbers)
        size = float(np.linalg.norm((w, x, y, z)))
    except ValueError:
        size = 0.0
    if kind is None or not 0.0 < size < np.inf:
        raise node.error(
            f"text '{node.xml.get('name')}' states none of {', '.join(PARTS)} with a quaternion; remove it "
            "to read MuJoCo's joints by themselves"
        )
    turn = rotation_from_quaternion(x / size, y / size, z / size, w / size)
    return kind, placement_from(turn, np.zeros(3))


def apply_joint_mark(robot: RobotFile, name: str, kind: JointKind, frame: Array) -> None:
    """Put a joint in the place of those that stand for it.

    Args:
        robot: The robot, with its links, joints and home.
        name: Name of the joint.
        frame: Its frame in the body, shape (4, 4).

    Raises:
        ModelError: A joint that stands for it is missing.
    """
    by_name = {joint.name: joint for joint in robot.joints}
    names = [name + ending for ending in PARTS[kind]]
    for part in names:
        if part not in by_name:
            raise ModelError(
                f"<custom> marks the joint '{name}', but there is no joint '{part}'"
                f"{did_you_mean(part, by_name)}; rename the text '{JOINT}{name}', or remove it",
                file=robot.file, element=name,
            )  # fmt: skip
    parts = [by_name[part] for part in names]
    first, last = parts[0], parts[-1]
    placement = np.linalg.multi_dot([np.eye(4), *(part.placement for part in parts), frame])
    turned = not np.array_equal(frame, np.eye(4))
    between = unique(f"{last.child}_{name}", {link.name for link in robot.links})
    whole = replace(
        last, name=name, kind=kind, parent=first.parent, placement=placement,
        child=between if turned else last.child, axis=np.array([0.0, 0.0, 1.0]),
    )  # fmt: skip
    new = [whole]
    if turned:
        taken = {*by_name} | {name}
        weld = Joint(
            unique(f"{last.child}_fixed", taken), "fixed", between, last.child, inverse(frame), first.axis
        )
        new.append(weld)
        robot.links.append(Link(between, 0.0, np.zeros(3), np.zeros((3, 3)), last.line, True))
    at = [joint.name for joint in robot.joints].index(first.name)
    robot.joints = [joint for joint in robot.joints if joint.name not in names]
    robot.joints[at:at] = new
    gone = {part.child for part in parts[:-1]}
    robot.links = [link for link in robot.links if link.name not in gone]
    robot.home[name] = _home(kind, [robot.home.pop(part) for part in names], frame)


def _home(kind: JointKind, parts: list[tuple[float, ...]], frame: Array) -> tuple[float, ...]:
    """Return the home position of a joint from those of the joints that stand for it."""
    *slides, turn = parts
    at = [x for (x,) in slides]
    if kind == "planar":
        return (*at, float(np.cos(turn[0])), float(np.sin(turn[0])))
    x, y, z = (float(part) for part in frame[:3, :3].T @ np.array(turn[:3]))
    return (*at, x, y, z, turn[3])
