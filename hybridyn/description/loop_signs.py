"""Refuse loops of a URDF in forms that are not read, and find signs of loops that no file states.

A closure is never dropped silently. Every element below `<robot>` is either read or searched for loops;
unknown elements are noted. The tag of a loop raises an error in a place where it is not read.

A robot that lost its loops would be loaded as a tree. Signs of this are frames named in pairs, joints of a
tree that look passive, and files of loops beside the robot. None of them proves a loop. The robot is
therefore loaded, and every sign is reported: `load` warns, and `info` lists them.
"""

from __future__ import annotations

import contextlib
import os
import re
from collections.abc import Container, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..errors import ModelError
from .motors import EVERY_JOINT, moved_by
from .names import DROPS, NOTHING, closest, listed
from .placement import outwards
from .records import Array, Description, Format, Joint, RobotFile
from .urdf.xml_node import XmlNode

ACCEPTED_FORMS = (
    "accepted forms: <loop>, <coupling> (URDF+), <mimic>, <loop_joint>, <constraint> (urdfdom), an SDF joint "
    "directly in <gazebo>, frames closing_x_1 and closing_x_2, or a side-car: robot.yaml (closed_loop: pairs "
    "of frames), submechanisms.yml, loop_closures.yaml"
)

#: Elements that are read below `<robot>`.
READ_TAGS = (
    "link", "joint", "transmission", "loop", "loop_joint", "constraint", "coupling", "drake:joint",
    "drake:ball_constraint", "drake:weld_constraint", "drake:tendon_constraint", "drake:linear_spring_damper",
    "drake:linear_bushing_rpy",
)  # fmt: skip

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
    "loopconstraint": "a form of biorbd; write it as <loop>",
    "drake:distance_constraint": "a Drake distance; write a rod without mass between two balls",
    "cable": "a cable of old Drake; hybridyn has no cables",
}

#: Tags of loops, and of followers.
LOOP_TAGS, MIMIC_TAGS = (*READ_TAGS[3:], *LEGACY_FORMS), ("mimic", "drake:mimic")

_LOOP_WORDS = r"(?i)loop|constraint|closure|closing|coupling|equality|weld|bushing|mimic|linkage"
_END_WORDS = {
    "predecessor", "successor", "link1", "link2", "link_a", "link_b", "body1", "body2", "joint1", "joint2",
}  # fmt: skip
_NAMED_FRAME = re.compile(r"closed_?loop|fermeture|loop_?closure", re.IGNORECASE)


def refuse_unread_loops(root: XmlNode, notes: list[str]) -> None:
    """Raise for loops in a form that is not read, or in a place where they are not read.

    Other unknown elements are noted.

    Raises:
        ModelError: There is such a loop; the message names the form, its line, and how to write it.
    """
    unknown: dict[str, XmlNode] = {}
    for node in root.children():
        if node.tag in LEGACY_FORMS:
            raise _refusal(node, LEGACY_FORMS[node.tag])
        if node.tag in ("include", "xi:include"):
            raise node.error("URDF includes no file; write <xacro:include> and name this file .xacro")
        if node.tag not in (*READ_TAGS, *HARMLESS_TAGS):
            _refuse_if_suspicious(node)
            unknown.setdefault(node.tag, node)
    for node in root.descendants(*LOOP_TAGS, *MIMIC_TAGS, "link", "joint"):
        if node.xml.getparent() is not root.xml:
            above = [XmlNode(xml, root.file) for xml in node.xml.iterancestors()]
            _refuse_inside(node, above[0], above[-2])
    if unknown:
        where = listed(f"<{tag}> ({node.where})" for tag, node in unknown.items())
        first = next(iter(unknown.values()))
        notes.append(f"{first.at}: {DROPS} unknown elements {where}; {NOTHING}, as in urdfdom")


def refuse_unclosed_frames(robot: RobotFile) -> None:
    """Raise for frames whose names state a closure (`closedloop1_A`) in a robot that states none.

    Raises:
        ModelError: There are such frames.
    """
    lines = {link.name: link.line for link in robot.links}
    lines |= {joint.name: joint.line for joint in robot.joints}
    named = [] if robot.closures else [name for name in lines if _NAMED_FRAME.search(name)]
    if named:
        raise ModelError(
            f"{listed(named)} looks like the end of a closed loop, but nothing says which frames close it; "
            f"list the pairs in a side-car robot.yaml, or write <loop>. A{ACCEPTED_FORMS[1:]}",
            file=robot.file,
            line=lines[named[0]],
            element=named[0],
        )


def _refuse_if_suspicious(node: XmlNode) -> None:
    """Raise for an unknown element below `<robot>` that may affect the dynamics."""
    intended = closest(node.tag, READ_TAGS)
    if intended:
        raise node.error(f"unknown element; did you mean <{intended}>?")
    inside = [*node.descendants()]
    words = {word for inner in (node, *inside) for word in inner.attributes()} | {
        inner.tag for inner in inside
    }
    outside = {*_END_WORDS, "parent", "child", *MIMIC_TAGS, "inertial"}
    loop = re.search(_LOOP_WORDS, node.tag) or _END_WORDS & words or {"parent", "child"} <= words
    if node.tag in outside or loop:
        raise _refusal(node, "an unknown form, or a part in the wrong place")
    if {"link", "joint"} & {inner.tag for inner in inside if inner.attrib.get("name")}:
        raise node.error(
            "unknown element that holds links or joints; they would be lost. Move them below <robot>"
        )


def _refuse_inside(node: XmlNode, above: XmlNode, top: XmlNode) -> None:
    """Raise for a loop in an element that is not read, and for tags in places where they are not read.

    Args:
        node: An element with one of these tags.
        above: The element around it.
        top: The element below `<robot>` that holds it.
    """
    direct = above.xml is top.xml
    if top.tag not in READ_TAGS:
        # joints of a whole robot are read
        in_gazebo = top.tag == "gazebo" and direct and "reference" not in top.attributes()
        if node.tag == "joint" and node.children("parent") and node.children("child") and not in_gazebo:
            raise _refusal(node, f"an SDF joint inside <{top.tag}> (Gazebo)")
        if node.tag in LOOP_TAGS:
            raise _refusal(node, f"inside <{top.tag}>")
        free = {"plugin", "sensor"} & {str(xml.tag) for xml in node.xml.iterancestors()}  # names of their own
        if node.tag == "link" and top.tag == "gazebo" and not free:
            raise node.error("is not read inside <gazebo>, and would be lost; move it below <robot>")
    in_part = node.tag in ("link", "joint") and top.tag in ("link", "joint")
    stray = node.tag in MIMIC_TAGS and not (top.tag in ("joint", "drake:joint") and direct)
    if node.tag in LOOP_TAGS or in_part or stray:
        raise node.error(f"is not read inside <{above.tag}>")


def _refusal(node: XmlNode, form: str) -> ModelError:
    return node.error(f"a loop closure in a form that is not read ({form}); {ACCEPTED_FORMS}")


#: Axes meet if they are closer than this fraction of the robot's largest offset: files keep 5 or 6 digits.
MEETING = 1e-5


def weightless(description: Description, shaped: Container[str] = ()) -> list[Joint]:
    """Return the joints that move a massless body which represents a real part.

    A body is a link with all links that fixed joints weld to it. It is only a frame, not a part, if
    everything that it carries is placed at its own joint: the crosses of universal and ball joints, the
    stages of a virtual leg. Links that a reader made between the joints of one body are frames, too.

    Args:
        description: The description of the robot.
        shaped: Links that have a shape; they are parts wherever their joints are placed.
    """
    bodies = WeldedBodies(description)
    exempt = {bodies.of[link.name] for link in description.links if link.mass or link.inertia.any()}
    exempt |= {link.name for link in description.links if link.between_joints}
    carried, farthest = bodies.carried(), dict[str, float]()
    points = np.array([point for _, point in carried]).reshape(-1, 3)
    meeting = MEETING * float(np.abs(points).max(initial=0.0))
    for (body, _), far in zip(carried, np.linalg.norm(points, axis=1).tolist(), strict=True):
        farthest[body] = max(farthest.get(body, 0.0), far)
    return [
        joint
        for joint in description.joints
        if joint.kind != "fixed"
        and joint.child not in exempt
        and (joint.child in shaped or farthest.get(joint.child, np.inf) > meeting)
    ]


def has_mass(description: Description) -> bool:
    """Check whether any link has mass or inertia, or any joint has rotor inertia."""
    return any(link.mass or link.inertia.any() for link in description.links) or any(
        joint.rotor_inertia for joint in description.joints
    )


class WeldedBodies:
    """Rigid bodies: links welded together by fixed joints.

    A body has the name of its first link: the child of the movable joint above it, or the root.

    Attributes:
        of: Name of the body of each link.
        placement: Frame of each link in the frame of its body, shape (4, 4).
    """

    def __init__(self, description: Description) -> None:
        self._description = description
        self.of = {description.root: description.root}
        self.placement: dict[str, Array] = {description.root: np.eye(4)}
        for joint in outwards(description.joints, [description.root]):
            welded = joint.kind == "fixed"
            self.of[joint.child] = self.of[joint.parent] if welded else joint.child
            self.placement[joint.child] = (
                self.placement[joint.parent] @ joint.placement if welded else np.eye(4)
            )

    def carried(self) -> list[tuple[str, Array]]:
        """Return a pair for each movable joint and closure end that a body carries.

        Returns:
            Pairs (name of the body, position in its frame, shape (3,), [m]).
        """
        at = [(joint.parent, joint.placement) for joint in self._description.joints if joint.kind != "fixed"]
        for closure in self._description.closures:
            at += [(closure.link_a, closure.frame_a), (closure.link_b, closure.frame_b)]
        return [(self.of[link], (self.placement[link] @ frame)[:3, 3]) for link, frame in at]


#: Names that suggest a loop.
LOOP_NAMES = r"(?i)closed_?loop|loop_?closure|fermeture|loop_?joint|(?<![a-z])closing(?![a-z])"
#: Names of two frames that suggest one, if several have such names.
PAIRED = r"(?i)(?<![a-z])(cut|weld|constraint)[_.-]?[0-2ab](?![a-z0-9])"
BESIDE = r"(?i).*(submechanism|loop_?closure|closed_?loop).*\.ya?ml"
FOLDERS = ("submechanism", "smurf")
#: How each format states loops.
STATE_THEM: dict[Format, str] = {
    "URDF": "state its loops as <loop>, or the pairs of frames in a side-car robot.yaml (closed_loop)",
    "MJCF": "state its loops as <connect> or <weld> in <equality>",
    "SDF": "state its loops as joints: a link may be the child of several",
    "USD": "state its loops as joints with excludeFromArticulation",
    "added": "let the reader of its format return them among the closures",
    "Pinocchio": "give its loops as constraint models",
}


class Sign(NamedTuple):
    """A sign of loops that are not stated.

    Attributes:
        message: The observation.
        mend: The correction.
        link: A link that it concerns, or None.
        joint: A joint that it concerns, or None.
    """

    message: str
    mend: str
    link: str | None = None
    joint: str | None = None


def lost_loops(description: Description) -> list[Sign]:
    """Return the signs that a robot had loops which its file does not state."""
    out = [*_named_frames(description)]
    return out if description.closures else [*out, *_passive_joints(description), *_files_beside(description)]


def _named_frames(description: Description) -> Iterator[Sign]:
    """Yield a sign for massless frames that are named for a loop, carry nothing, and that no closure uses."""
    taken = {joint.parent for joint in description.joints}
    taken |= {link for closure in description.closures for link in (closure.link_a, closure.link_b)}
    taken |= {link.name for link in description.links if link.mass or link.inertia.any()}
    frames = [joint for joint in description.joints if joint.kind == "fixed" and joint.child not in taken]
    named, paired = (
        [one.child for one in frames if re.search(words, f"{one.child} {one.name}")]
        for words in (LOOP_NAMES, PAIRED)
    )
    if named := named + paired * (len(paired) > 1):
        message = f"massless frames {listed(named)} are named for closing a loop, but no closure uses them"
        yield Sign(message, STATE_THEM[description.format], link=named[0])


def _passive_joints(description: Description) -> Iterator[Sign]:
    """Yield signs for joints of a tree that its file treats as passive: only a loop would move them."""
    named = {joint.name: joint for joint in description.joints}
    mend = (
        f"name the motors (motors = [...] in model.toml); if it has loops, {STATE_THEM[description.format]}"
    )
    if description.motors_from == EVERY_JOINT:
        driven = [named[name] for name in description.motors]
        weak = [j for j in driven if j.effort == 0.0]
        strong = [j for j in driven if 0.0 < j.effort < np.inf]
        if weak and strong:
            yield Sign(
                f"{len(weak)} of its {len(driven)} joints state effort 0, as passive joints of loops do "
                f"({listed(j.name for j in weak)}), yet each counts as a motor: no closure is stated",
                mend,
                joint=weak[0].name,
            )
        elif driven and not strong and _is_suspicious(description, weak):
            yield Sign(
                f"none of its {len(driven)} joints states an effort above 0, so every one counts as a motor, "
                "and no closure is stated",
                mend,
                joint=driven[0].name,
            )
    elif told := [word for word in ("<transmission>", "<ros2_control>") if word in description.motors_from]:
        moved = moved_by(description.motors, description.couplings)
        passive = [j.name for j in description.joints if j.kind.single and j.name not in moved]
        if passive:
            yield Sign(
                f"{told[0]} drives {len(description.motors)} joints and leaves these passive: "
                f"{listed(passive)}; they move freely, because no closure is stated",
                f"if they are driven too, {mend}",
                joint=passive[0],
            )


def _is_suspicious(description: Description, weak: list[Joint]) -> bool:
    """Check whether joints without effort are passive joints, rather than joints without stated limits.

    They are if each of several joints states effort 0, or if chains of joints branch: a loop that was cut
    open leaves two chains. Bodies that float are no chains, nor are those that couplings move with others.
    """
    coupled = {name for one in description.couplings for name, _ in one.terms} - {*description.motors}
    movable = [one for one in description.joints if one.kind != "fixed" and one.name not in coupled]
    bodies = WeldedBodies(description)
    tips = {joint.child for joint in movable if joint.kind != "floating"}
    ends = tips - {bodies.of[joint.parent] for joint in movable}
    return len(weak) == len(description.motors) > 1 or len(ends) > 1


def _names_in(folder: Path) -> list[str]:
    """Return the names in a folder, none where there is no folder that can be read."""
    with contextlib.suppress(OSError):
        return os.listdir(folder)
    return []


def _files_beside(description: Description) -> Iterator[Sign]:
    """Yield a sign for files of loops in the robot's folder, or in a folder that Phobos writes."""
    if description.source is None:
        return
    folder = Path(description.source).absolute().parent
    beside = [(above, name) for above in (folder, folder.parent) for name in _names_in(above)]
    folders = [folder, *(above / name for above, name in beside if name.lower().startswith(FOLDERS))]
    found = [name for place in folders for name in sorted(_names_in(place)) if re.fullmatch(BESIDE, name)]
    if found:
        names = listed(dict.fromkeys(found))
        yield Sign(
            f"{names} beside it may state its loops, but is not read; the file itself states none",
            f"{STATE_THEM[description.format]}; move the file away if it belongs to another robot",
        )
