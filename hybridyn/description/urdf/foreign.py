"""Recognise loops that are written in a form that is not read, and raise an error that names the form.

A closure is never dropped silently. Every element below `<robot>` is therefore either read or searched for
loops; unknown elements are noted. The tag of a loop raises an error in a place where it is not read. Other
formats are named, even where their text is not well-formed XML.
"""

from __future__ import annotations

import re
from pathlib import Path

from ...errors import ModelError
from ..names import closest, listed
from ..records import RobotFile
from .xml_node import Node

ACCEPTED_FORMS = (
    "accepted forms: <loop>, <coupling> (URDF+), <mimic>, <loop_joint>, an SDF joint directly in <gazebo>, "
    "frames closing_x_1 and closing_x_2, or a side-car robot.yaml (closed_loop: pairs of frames)"
)

#: Elements that are read below `<robot>`.
READ_TAGS = ("link", "joint", "transmission", "loop", "loop_joint", "coupling")

#: Elements below `<robot>` that do not affect the dynamics, unless they contain loops.
HARMLESS_TAGS = (
    "material", "gazebo", "sensor", "ros2_control", "mujoco", "frame", "fixed_frame", "virtual_joint",
    "group", "group_state", "end_effector", "disable_collisions", "passive_joint", "version", "author",
    "license", "description", "plugin", "drake:collision_filter_group", "collision_filter_group",
)  # fmt: skip

#: Forms that are recognised but not read, with the supported way to write them.
LEGACY_FORMS = {
    "loop_constraint": 'an early form of URDF+; write <loop type="..."> with <predecessor> and <successor>',
    "joint_constraint": "an early form of URDF+; write <coupling> with <predecessor>, <successor>, <ratio>",
    "constraint": 'a proposal of urdfdom that no robot file uses; write it as <loop type="...">',
    "loopconstraint": "a form of biorbd; write it as <loop>",
    "drake:ball_constraint": 'a Drake ball constraint; write it as <loop type="spherical">',
    "drake:linear_bushing_rpy": 'a Drake bushing (soft closure); write it as a rigid <loop type="revolute">',
    "drake:weld_constraint": 'a Drake weld; write it as <loop type="fixed">',
    "drake:distance_constraint": "a Drake distance; write a rod without mass between two balls",
    "drake:tendon_constraint": "a Drake tendon; hybridyn has no cables, write <coupling> or <mimic>",
    "drake:linear_spring_damper": "a Drake spring between two points; hybridyn has springs in joints",
    "drake:joint": "a Drake joint; write it as one-freedom joints with massless links between them",
    "cable": "a cable of old Drake; hybridyn has no cables",
}

#: Tags of loops, and of followers.
LOOP_TAGS, MIMIC_TAGS = (*READ_TAGS[3:], *LEGACY_FORMS), ("mimic", "drake:mimic")

#: Files beside a robot that state closures in forms that are not read, and the tools that write them.
UNREAD_SIDE_CARS = {"loop_closures.yaml": "scikit-robot", "loop_closures.yml": "scikit-robot"}

#: Messages for files of other formats than URDF, by the name of the root element.
OTHER_FORMATS = {
    "mujocoinclude": "this is a part of an MJCF file (MuJoCo); name the file that includes it",
    "mujoco": "this is MJCF (MuJoCo)",
    "sdf": "this is SDF (Gazebo)",
}

_LOOP_WORDS = r"(?i)loop|constraint|closure|closing|coupling|equality|weld|bushing|mimic|linkage"
_END_WORDS = {
    "predecessor", "successor", "link1", "link2", "link_a", "link_b", "body1", "body2", "joint1", "joint2",
}  # fmt: skip
_NAMED_FRAME = re.compile(r"closed_?loop|fermeture|loop_?closure", re.IGNORECASE)


def refuse_unread_loops(root: Node, notes: list[str]) -> None:
    """Raise for loops in a form that is not read, or in a place where they are not read.

    Other unknown elements are noted.

    Raises:
        ModelError: There is such a loop; the message names the form, its line, and how to write it.
    """
    unknown: dict[str, str] = {}
    for node in root.children():
        if node.tag in LEGACY_FORMS:
            raise _refusal(node, LEGACY_FORMS[node.tag])
        if node.tag in ("include", "xi:include"):
            raise node.error("URDF includes no file; write <xacro:include> and name this file .xacro")
        if node.tag not in (*READ_TAGS, *HARMLESS_TAGS):
            _refuse_if_suspicious(node)
            unknown.setdefault(node.tag, node.where)
    for node in root.descendants(*LOOP_TAGS, *MIMIC_TAGS, "link", "joint"):
        above = [Node(xml, root.file) for xml in node.xml.iterancestors()]
        if len(above) > 1:
            _refuse_inside(node, above[0], above[-2])
    if unknown:
        where = listed(f"<{tag}> ({place})" for tag, place in unknown.items())
        notes.append(f"unknown elements, which were not read: {where}")


def refuse_unclosed_frames(robot: RobotFile) -> None:
    """Raise for frames that no closure uses, but whose names state one (`closedloop1_A`).

    If the robot states other closures, frames such as `closedloop1_A` are noted.

    Raises:
        ModelError: There are such frames.
    """
    used = {name for closure in robot.closures for name in (closure.link_a, closure.link_b)}
    lines = {link.name: link.line for link in robot.links}
    lines |= {joint.name: joint.line for joint in robot.joints if joint.child not in used}
    free = [name for name in lines if name not in used]
    named = [name for name in free if _NAMED_FRAME.search(name)]
    if named and robot.closures:
        robot.notes.append(f"frames {listed(named)} are named for closing a loop, but no closure uses them")
    elif named:
        raise ModelError(
            f"{listed(named)} looks like the end of a closed loop, but nothing says which frames close it; "
            f"list the pairs in a side-car robot.yaml, or write <loop>. A{ACCEPTED_FORMS[1:]}",
            file=robot.file,
            line=lines[named[0]],
            element=named[0],
        )


def refuse_unread_side_cars(robot: RobotFile, folder: Path) -> None:
    """Raise for side-cars in forms that are not read; if the robot states closures, only note them.

    Raises:
        ModelError: There is such a file, and the robot states no closure.
    """
    for name, form in UNREAD_SIDE_CARS.items():
        if not (folder / name).is_file():
            continue
        if not robot.closures:
            raise ModelError(
                f"{name} beside it ({form}) may state loop closures, but is not read; move it away if it "
                f"belongs to another robot. A{ACCEPTED_FORMS[1:]}",
                file=robot.file,
                element=name,
            )
        robot.notes.append(f"{name} ({form}) is beside the robot file and was not read")


def note_mimic_plugins(root: Node, robot: RobotFile) -> None:
    """Note the joints that mimic others by a Gazebo plugin, but not by `<mimic>` in the URDF."""
    coupled = {coupling.name for coupling in robot.couplings}
    movable = {joint.name for joint in robot.joints if joint.kind != "fixed"}
    plugins = [node for block in root.children("gazebo") for node in block.descendants("mimicJoint")]
    lost = [node.content() for node in plugins if node.content() in movable - coupled]
    if lost:
        robot.notes.append(
            f"joints {listed(lost)} mimic others by a Gazebo plugin, which is not read: they move freely "
            "here; to couple them, write <mimic> in the joint"
        )


def _refuse_if_suspicious(node: Node) -> None:
    """Raise for an unknown element below `<robot>` that may affect the dynamics."""
    intended = closest(node.tag, READ_TAGS)
    if intended:
        raise node.error(f"unknown element; did you mean <{intended}>?")
    inside = [*node.descendants()]
    words = {word for inner in (node, *inside) for word in inner.attributes()} | {
        inner.tag for inner in inside
    }
    if node.tag in {*_END_WORDS, "parent", "child", *MIMIC_TAGS, "inertial"}:
        raise node.error(f"is not read directly below <robot>; {ACCEPTED_FORMS}")
    if re.search(_LOOP_WORDS, node.tag) or _END_WORDS & words or {"parent", "child"} <= words:
        raise _refusal(node, "an unknown form")
    if {"link", "joint"} & {inner.tag for inner in inside if inner.xml.get("name")}:
        raise node.error(
            "unknown element that holds links or joints; they would be lost. Move them below <robot>"
        )


def _refuse_inside(node: Node, above: Node, top: Node) -> None:
    """Raise for a loop in an element that is not read, and for tags in places where they are not read.

    Args:
        node: An element with one of these tags.
        above: The element around it.
        top: The element below `<robot>` that holds it.
    """
    direct = above.xml is top.xml
    if top.tag not in READ_TAGS:
        in_gazebo = top.tag == "gazebo" and direct and "reference" not in top.attributes()  # see `gazebo.py`
        if node.tag == "joint" and node.children("parent") and node.children("child") and not in_gazebo:
            raise _refusal(node, f"an SDF joint inside <{top.tag}> (Gazebo)")
        if node.tag in LOOP_TAGS:
            raise _refusal(node, f"inside <{top.tag}>")
    in_part = node.tag in ("link", "joint") and top.tag in ("link", "joint")
    stray = node.tag in MIMIC_TAGS and not (top.tag == "joint" and direct)
    if node.tag in LOOP_TAGS or in_part or stray:
        raise node.error(f"is not read inside <{above.tag}>")


def _refusal(node: Node, form: str) -> ModelError:
    return node.error(f"a loop closure in a form that is not read ({form}); {ACCEPTED_FORMS}")
