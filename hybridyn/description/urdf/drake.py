"""Read Drake's own elements of a URDF: joints, and constraints between two links.

A `<drake:joint>` with several axes is a chain of joints with massless links between them, as in SDF. A screw
is a hinge and a slide, which a coupling ties. Its pitch is the way per turn [m], positive if right-handed.

Source: Drake's reader of URDF; the frames are those of `UniversalJoint`, `PlanarJoint`, `ScrewJoint`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ...joints.kinds import JointKind
from ...spatial import rotation_from_axis_angle
from ..closure_forms import Side, closure_of
from ..joint_chains import add_chain, step
from ..joint_words import HINGE, WORDS, called
from ..names import did_you_mean, listed, unique
from ..placement import placement_from
from ..records import Array, Closure, Coupling, Joint, RobotFile
from .xml_node import XmlNode, axis_of, origin_of

X, Y, Z = np.eye(3)

BALL, WELD, TENDON = "drake:ball_constraint", "drake:weld_constraint", "drake:tendon_constraint"

#: Returns the link that a name in an element means.
Named = Callable[[XmlNode, str], str]


def as_stated(_: XmlNode, name: str) -> str:
    """Return the name: in URDF names are those of links."""
    return name


#: Joints that `<drake:joint>` may have, by type. Drake has the others as `<joint>`.
DRAKE = called("drake")
KINDS = sorted(DRAKE)

#: The pitch of a screw.
PITCH = "drake:screw_thread_pitch"

#: Elements of rotors.
ROTORS = ("rotor_inertia", "drake:rotor_inertia", "gear_ratio", "drake:gear_ratio")

#: Reads `<limit>`, `<dynamics>` and the rotor of a joint of a kind, as fields of `records.Joint`.
Numbers = Callable[[XmlNode, str, JointKind], dict[str, Any]]


def read_ball_constraint(node: XmlNode, named: Named = as_stated) -> Closure:
    """Read `<drake:ball_constraint>`: point P of body A and point Q of body B coincide.

    Args:
        node: The element; it states names and numbers as attributes (URDF) or as text (SDF).
        named: Returns the link of a name.
    """
    sides = sides_of(node, {"p_AP": point, "p_BQ": point}, named)
    return closure_of(constraint_name(node), JointKind.SPHERICAL, sides, line=node.line)


def read_weld_constraint(node: XmlNode) -> Closure:
    """Read `<drake:weld_constraint>`: frame P of body A and frame Q of body B coincide.

    Drake's reader has no such element. Its words are those of `AddWeldConstraint`; a frame that is left out
    is that of the body.
    """
    sides = sides_of(node, {"X_AP": _frame, "X_BQ": _frame}, as_stated, needed=False)
    return closure_of(constraint_name(node), "fixed", sides, line=node.line)


def sides_of(
    node: XmlNode,
    places: dict[str, Callable[[XmlNode], Array]],
    named: Named,
    more: Sequence[str] = (),
    *,
    needed: bool = True,
) -> list[Side]:
    """Return both sides of what stands between two bodies.

    Args:
        node: The element.
        places: Reads where it is in each body; it has to be stated if `needed`.
        named: As in `read_ball_constraint`.
        more: Ends of the names of its other children.
        needed: As above.
    """
    words = {word: f"{node.tag}_{word}" for word in ("body_A", "body_B", *places, *more)}
    node.only(["name"], [*words.values()])
    sides = []
    for body, (word, place) in zip(("body_A", "body_B"), places.items(), strict=True):
        link, at = node.required_child(words[body]), node.child(words[word])
        link.only(["name"], [])
        if at is None and needed:
            raise node.error(f"<{words[word]}> is missing")
        name = link.content() or link.text("name")
        sides.append((named(link, name), np.eye(4) if at is None else place(at)))
    return sides


def constraint_name(node: XmlNode) -> str:
    """Return the name of a constraint: stated, or its word with its number among those of the file."""
    number = 1 + sum(1 for _ in node.xml.itersiblings(node.xml.tag, preceding=True))
    return node.attrib.get("name", "").strip() or f"{node.tag.rpartition(':')[2]}{number}"


def point(node: XmlNode) -> Array:
    """Return the placement of a point, shape (4, 4): three numbers in an attribute or as text."""
    node.only(["value"], [])
    return placement_from(np.eye(3), node.numbers("value" if "value" in node.attrib else "", 3))


def _frame(node: XmlNode) -> Array:
    node.only(["xyz", "rpy", "quat_xyzw"], [])
    return origin_of(node)


def read_tendon(node: XmlNode) -> Coupling:
    """Read a `<drake:tendon_constraint>` of fixed length: sum of a x position + offset = limit.

    Raises:
        ModelError: The length may vary, or the tendon is elastic.
    """
    words = {
        word: f"{TENDON}_{word}" for word in ("offset", "lower_limit", "upper_limit", "stiffness", "damping")
    }
    node.only(["name"], [f"{TENDON}_joint", *words.values()])
    stated = {word: child.number("value") for word, tag in words.items() if (child := node.child(tag))}
    lower, upper = stated.get("lower_limit", -math.inf), stated.get("upper_limit", math.inf)
    if lower != upper or {"stiffness", "damping"} & stated.keys():
        raise node.error(
            "a tendon whose length may vary is not read; a rigid one states the same lower and upper limit, "
            "and neither stiffness nor damping"
        )
    joints = node.children(f"{TENDON}_joint")
    for joint in joints:
        joint.only(["name", "a"], [])
    terms = tuple((joint.text("name"), joint.number("a")) for joint in joints)
    return Coupling(constraint_name(node), terms, lower - stated.get("offset", 0.0), node.line)


def is_drakes(node: XmlNode) -> bool:
    """Return whether a joint is one of Drake: by its tag, or planar with a damping for each freedom."""
    dynamics = node.child("dynamics")
    three = dynamics is not None and len(dynamics.attrib.get("damping", "").split()) == 3
    return node.tag == "drake:joint" or (three and node.attrib.get("type") == WORDS[JointKind.PLANAR].drake)


def read_drake_joint(node: XmlNode, robot: RobotFile, numbers: Numbers) -> None:
    """Add a `<drake:joint>` to the robot.

    Args:
        node: The element.
        robot: The robot, which has its links.
        numbers: Reads what the joint states beside its frames.

    Raises:
        ModelError: Drake has no such joint, or it has one whose path is a curve.
    """
    kind = node.text("type")
    if kind == "curvilinear":
        raise node.error(
            "a joint along a curve is not read: hybridyn has no path of arcs; write slides and hinges"
        )
    if kind not in KINDS:
        raise node.error(
            f"Drake has no such type '{kind}'{did_you_mean(kind, KINDS)} in <drake:joint>; known: "
            f"{listed(KINDS)}. Those of URDF stand in <joint>"
        )
    if DRAKE[kind].chain != (JointKind.SCREW,) and node.children(*ROTORS):
        raise node.error(f"a rotor does not say about which axis of a {kind} joint it turns; write hinges")
    ends = [node.required_child(tag).text("link") for tag in ("parent", "child")]
    axis = _stated_axis(node, kind, robot)
    chain = CHAINS[DRAKE[kind].chain](node, axis, robot, numbers)
    chain[0] = replace(chain[0], placement=origin_of(node.child("origin")) @ chain[0].placement)
    taken = {link.name for link in robot.links}
    between = [unique(f"{ends[1]}_{one.name}", taken) for one in chain[:-1]]
    add_chain(robot, [replace(one, line=node.line) for one in chain], [ends[0], *between, ends[1]])


def _stated_axis(node: XmlNode, kind: str, robot: RobotFile) -> Array:
    """Return the unit axis of a joint; note one that Drake ignores."""
    axis = node.child("axis")
    turns = TURNS.get(DRAKE[kind].chain)
    if axis is not None and turns:
        robot.notes.append(
            f"{axis.at}: the axis of {kind} joint '{node.text('name')}' is ignored: it turns {turns}, as in "
            "Drake"
        )
    return axis_of(axis)


def _joint_names(node: XmlNode, robot: RobotFile, *endings: str) -> list[str]:
    """Return names of joints that no joint of the file has: that of the joint with each ending."""
    above = node.xml.getparent()
    found = XmlNode(above, node.file).children("joint", "drake:joint") if above is not None else []
    taken = {one.attrib.get("name", "") for one in found} | {joint.name for joint in robot.joints}
    return [unique(f"{node.text('name')}{ending}", taken) for ending in endings]


def _ball(node: XmlNode, axis: Array, robot: RobotFile, numbers: Numbers) -> list[Joint]:
    return [
        step(node.text("name"), JointKind.SPHERICAL, **numbers(node, node.text("name"), JointKind.SPHERICAL))
    ]


def _universal(node: XmlNode, axis: Array, robot: RobotFile, numbers: Numbers) -> list[Joint]:
    """Return hinges about x and y. The damping is that of each."""
    names = _joint_names(node, robot, "_1", "_2")
    stated = numbers(node, node.text("name"), JointKind.SPHERICAL)
    return [step(name, JointKind.REVOLUTE, turn, **stated) for name, turn in zip(names, (X, Y), strict=True)]


def _screw(node: XmlNode, axis: Array, robot: RobotFile, numbers: Numbers) -> list[Joint]:
    """Return a screw; one of no pitch is a hinge."""
    stated = node.required_child(PITCH)
    stated.only(["value"], [])
    pitch, name = stated.number("value") / (2 * math.pi), node.text("name")
    kind = JointKind.SCREW if pitch else JointKind.REVOLUTE
    return [step(name, kind, axis, pitch=pitch, **numbers(node, name, kind))]


def _planar(node: XmlNode, axis: Array, robot: RobotFile, numbers: Numbers) -> list[Joint]:
    """Return a planar joint, or slides and a hinge where its three dampings differ, and a weld to the link.

    The normal is the axis. The frame of the joint is that of the child, turned by the least angle.
    """
    name, dynamics = node.text("name"), node.child("dynamics")
    x = (
        dynamics.numbers("damping", 3)
        if dynamics is not None and "damping" in dynamics.attrib
        else np.zeros(3)
    )
    if (x < 0).any():
        raise node.error(f"joint '{name}' has negative damping ({listed(map(str, x))})")
    if node.child("limit") is not None:
        robot.notes.append(f"{node.at}: limits of the planar joint '{name}' are ignored, as in Drake")
    turn = least_turn(axis)
    place, back = placement_from(turn, np.zeros(3)), placement_from(turn.T, np.zeros(3))
    if x.any():
        parts = JointKind.PLANAR.parts
        steps = zip(_joint_names(node, robot, *parts), parts.values(), (X, Y, Z), x, strict=True)
        chain = [step(each, kind, along, damping=float(damping)) for each, kind, along, damping in steps]
    else:
        chain = [step(name, JointKind.PLANAR, Z)]
    if not np.array_equal(turn, np.eye(3)):
        (weld,) = _joint_names(node, robot, "_frame")
        chain.append(replace(step(weld, JointKind.FIXED), placement=back))
    chain[0] = replace(chain[0], placement=place)
    return chain


def least_turn(axis: Array) -> Array:
    """Return the rotation by the least angle that maps z to a unit axis, shape (3, 3); about x for -z."""
    across = np.cross(Z, axis)
    sine = float(np.linalg.norm(across))
    about = across / sine if sine else X
    return rotation_from_axis_angle(about, np.asarray(axis[2]), np.asarray(sine))


#: Makers of joints.
CHAINS: dict[tuple[JointKind, ...], Callable[[XmlNode, Array, RobotFile, Numbers], list[Joint]]] = {
    (JointKind.SPHERICAL,): _ball, (JointKind.PLANAR,): _planar, (JointKind.SCREW,): _screw,
    (HINGE, HINGE): _universal,
}  # fmt: skip
#: About what joints without an axis of their own turn.
TURNS = {(JointKind.SPHERICAL,): "about every axis", (HINGE, HINGE): "about x, then y of its frame"}
