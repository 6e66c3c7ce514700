"""Read the joints in the `<gazebo>` blocks of a URDF, which are those of SDF.

`<parent>` and `<child>` name links, `<pose>` places the joint in the child's frame. The joint is at zero
where all joints are, because SDF places its links in this posture. A joint closes a loop; a gearbox couples
joints; a screw stays in the tree, with a massless link that is welded to its child. Where a joint holds a
link in the world, a link `world` becomes the root: it is the base, or the robot floats and hangs there.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np

from ...joints.kinds import JointKind
from ..closure_forms import FORMS, LARGEST_COSINE, closure_of
from ..gearboxes import Gearbox, coupling_of
from ..joint_chains import add_chain, pose_coordinates, step
from ..joint_words import UNIVERSAL
from ..names import DROPS, did_you_mean, unique
from ..placement import placement_from, poses_at_zero, relative, rotation_from_rpy, rotation_to_axis
from ..records import Array, Coupling, RobotFile, massless
from ..sdf.elements import flag, numbers, screw_pitch
from ..sdf.stated import SCREW, SDF
from .kept_joints import keep_joint
from .loops import kind_of
from .xml_node import XmlNode, unit

#: Closures by the type of the joint in SDF. A screw that does not slide is a hinge; others stay joints.
GAZEBO_TYPES = {
    word: joint.closure or JointKind.REVOLUTE
    for word, joint in SDF.items()
    if joint.closure or joint.chain == (JointKind.SCREW,)
} | {"gearbox": "gearbox"}
MODEL, WORLD = "__model__", "world"
OBLIQUE = "the axes of a universal joint are perpendicular; mend them, or write two revolute joints"
PARTS = (
    "parent", "child", "pose", "axis", "axis2", "physics", "sensor", "gearbox_ratio",
    "gearbox_reference_body", "thread_pitch", "screw_thread_pitch",
)  # fmt: skip


def read_gazebo_joints(
    nodes: list[XmlNode], welds: Iterable[tuple[XmlNode, tuple[XmlNode, XmlNode]]], robot: RobotFile
) -> None:
    """Add the joints of the blocks to the robot, and the welds of its plugins.

    Args:
        nodes: The elements of joints.
        welds: Plugins that weld two links, and the elements that name these.
        robot: The robot.

    Raises:
        ModelError: A joint has another type, or names what does not exist.
    """
    poses = poses_at_zero(robot.joints) | {MODEL: np.eye(4)}  # of links and model, shapes (4, 4)
    held = [node for node in nodes if WORLD not in poses and WORLD in _end_names(node)]
    if held:
        carrier = _add_world(held, robot, poses)
        nodes = [node for node in nodes if node is not carrier]
    for node in sorted(nodes, key=lambda node: node.attrib.get("type") == "gearbox"):
        _read_joint(node, poses, robot)
    for plugin, ends in welds:
        _weld(plugin, ends, poses, robot)


def _weld(
    plugin: XmlNode, ends: tuple[XmlNode, XmlNode], poses: Mapping[str, Array], robot: RobotFile
) -> None:
    """Add the weld of a DetachableJoint: the two links keep the place that they have at zero."""
    parent, child = (link_of(end, poses) for end in ends)
    name = unique(f"weld_{parent}_{child}", {closure.name for closure in robot.closures})
    sides = (parent, relative(poses[parent], poses[child])), (child, np.eye(4))
    robot.closures.append(closure_of(name, "fixed", sides, line=plugin.line))


def _end_names(node: XmlNode) -> list[str]:
    return [end.content() for end in node.children("parent", "child")]


def _add_world(held: list[XmlNode], robot: RobotFile, poses: dict[str, Array]) -> XmlNode | None:
    """Make the world the robot's root; return the joint that fixes the former root in it, or None.

    Args:
        held: The joints that hold links in the world.
        robot: The robot.
        poses: Pose of each link where all joints are at zero, and of the model, shapes (4, 4); that of the
            world is added.
    """
    children = {joint.child for joint in robot.joints}
    root = next((link.name for link in robot.links if link.name not in children), "")
    poses[WORLD] = np.eye(4)
    robot.links.insert(0, massless(WORLD))
    carrier = next((node for node in held if node.text("type") == "fixed" and root in _end_names(node)), None)
    name = carrier.text("name") if carrier else f"{root}_free"
    joint = step(
        unique(name, {joint.name for joint in robot.joints}),
        JointKind.FIXED if carrier else JointKind.FLOATING,
    )
    add_chain(robot, [replace(joint, line=(carrier or held[0]).line)], [WORLD, root])
    if carrier is None:
        robot.home[joint.name] = pose_coordinates(np.eye(4))
        robot.notes.append(
            f"{held[0].at}: this joint holds a link in the world; the robot floats and hangs on it, as in "
            "Gazebo"
        )
    return carrier


def _read_joint(node: XmlNode, poses: Mapping[str, Array], robot: RobotFile) -> None:
    stated = kind_of(node, GAZEBO_TYPES, "an SDF joint of type '{}' closes no loop here; write it as <loop>")
    kind = GAZEBO_TYPES[stated]
    node.only(["name", "type"], PARTS)
    pitch = screw_pitch(node) if stated == SCREW else 0.0
    ends = [link_of(node.required_child(end), poses) for end in ("parent", "child")]
    at = _place(node, ends[1], poses)
    tags = {UNIVERSAL: ("axis", "axis2"), "gearbox": ("axis", "axis2")}.get(
        kind, ("axis",) if kind in FORMS and FORMS[kind].has_axis else ()
    )
    axes = [node.required_child(tag) for tag in tags]
    directions, forces = [_direction(axis, at, poses) for axis in axes], dict[str, float]()
    for axis in axes:
        forces |= {
            word: value for word, value in numbers(axis.child("dynamics"), "dynamics").items() if value
        }
        if axis.child("limit"):
            robot.notes.append(f"{axis.at}: 'limit' of the SDF joint '{node.text('name')}' is not read")
    if kind == "gearbox":
        robot.couplings.append(_gearbox(node, ends, [at[:3, :3] @ axis for axis in directions], poses, robot))
        if forces:
            robot.notes.append(f"{node.at}: {DROPS} the forces of gearbox '{node.text('name')}'")
        return
    if len(axes) == 2 and abs(directions[0] @ directions[1]) > LARGEST_COSINE:
        raise node.error(OBLIQUE)
    turns = [rotation_to_axis(direction) for direction in directions] or [np.eye(3)]
    sides = [(link, relative(poses[link], at)) for link in ends]
    closure = closure_of(node.text("name"), kind, sides, (turns[0], turns[-1]), line=node.line)
    keep_joint(robot, closure, forces, poses, node, pitch)


def _gearbox(
    node: XmlNode, ends: list[str], axes: list[Array], poses: Mapping[str, Array], robot: RobotFile
) -> Coupling:
    """Return the coupling of a gearbox. `axes`: in the frame of the model, shapes (3,)."""
    own = [poses[link][:3, :3].T @ axis for link, axis in zip(ends, axes, strict=True)]
    reference = link_of(node.required_child("gearbox_reference_body"), poses)
    ratio = numbers(node, "joint")["gearbox_ratio"]
    box = Gearbox(node.text("name"), (ends[0], ends[1]), (own[0], own[1]), reference, ratio, node.line)
    try:
        return coupling_of(box, robot)
    except ValueError as error:
        raise node.error(str(error)) from None


def _place(node: XmlNode, child: str, poses: Mapping[str, Array]) -> Array:
    """Return the frame of a joint in that of the model, shape (4, 4)."""
    stated = node.child("pose")
    if stated is None:
        return poses[child]
    stated.only(["relative_to", "frame"], [])
    frame = stated.attrib.get("relative_to") or stated.attrib.get("frame") or child
    place = stated.numbers("", 6) if stated.content() else np.zeros(6)
    return _frame(stated, frame, poses) @ placement_from(rotation_from_rpy(*place[3:]), place[:3])


def link_of(node: XmlNode, poses: Mapping[str, Array]) -> str:
    """Return the link that an end of the joint names."""
    node.only([], [])
    name = node.content()
    if name not in poses or name == MODEL:
        raise node.error(f"unknown link '{name}'{did_you_mean(name, poses)}")
    return name


def _direction(node: XmlNode, at: Array, poses: Mapping[str, Array]) -> Array:
    """Return the unit axis in the joint's frame, shape (3,)."""
    xyz, value, frame = node.child("xyz"), np.array([0.0, 0.0, 1.0]), ""
    if xyz is not None:
        value, frame = unit(xyz, xyz.numbers("", 3), "<xyz>0 0 1</xyz>"), xyz.attrib.get("expressed_in", "")
    if flag(node, "use_parent_model_frame"):
        frame = MODEL
    return at[:3, :3].T @ _frame(node, frame, poses)[:3, :3] @ value if frame else value


def _frame(node: XmlNode, name: str, poses: Mapping[str, Array]) -> Array:
    if name not in poses:
        raise node.error(f"unknown frame '{name}'{did_you_mean(name, poses)}; name a link, or {MODEL}")
    return poses[name]
