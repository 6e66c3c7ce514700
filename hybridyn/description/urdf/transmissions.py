"""Read the `<transmission>`s of a URDF: driven joints, and the rotors behind them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from ...errors import ModelError
from ...joints.kinds import JointKind
from ..names import DROPS, listed, unique
from ..records import Coupling, Joint, MotorStatement, RobotFile, massless
from .xml_node import XmlNode

DRIVEN_TAGS = ("joint", "flexJoint", "rollJoint")
#: Elements that state the rotor of a motor, and the field of `records.Joint`; the first that stands counts.
ROTOR_TAGS = {
    "drake:rotor_inertia": "rotor_inertia", "rotor_inertia": "rotor_inertia", "rotorInertia": "rotor_inertia",
    "drake:gear_ratio": "gear_ratio", "gear_ratio": "gear_ratio", "mechanicalReduction": "gear_ratio",
    "mechanical_reduction": "gear_ratio",
}  # fmt: skip

#: Inertia and ratio of a rotor as fields of `records.Joint`, where they are stated.
Rotor = dict[str, Any]


def read_transmissions(root: XmlNode, robot: RobotFile) -> dict[str, Rotor]:
    """Read every `<transmission>`, and add its joints to the motors, except fixed joints.

    Returns:
        The rotors by joint name. For a transmission with several joints or actuators, the values inside its
        `<joint>` elements count, and equal rotors of a differential. The rotors of several transmissions of
        a joint add.
    """
    nodes = root.children("transmission")
    rotors: dict[str, Rotor] = {}
    for node in nodes:
        joints, actuators = node.children(*DRIVEN_TAGS), node.children("actuator")
        if not joints:
            robot.notes.append(f"{node.at}: {node.label} names no <joint> and drives nothing")
        own = {joint.text("name"): read_rotor(joint, robot.notes) for joint in joints}
        if len(joints) == 1 and len(actuators) <= 1:
            (name,) = own
            for owner in (*actuators, node):
                own[name] = _with(owner, own[name], robot.notes)
        else:
            _share_rotors(node, joints, own, robot)
        for name, rotor in own.items():
            rotors[name] = _added(node, name, rotors.get(name, {}), rotor, robot.notes)
    fixed = [joint.name for joint in robot.joints if joint.kind == "fixed" and joint.name in rotors]
    if fixed:
        robot.notes.append(f"<transmission> names fixed joints, which cannot be driven: {listed(fixed)}")
    if rotors:
        driven, where = tuple(name for name in rotors if name not in fixed), "URDF <transmission>"
        robot.motors.append(MotorStatement("transmission", where, driven, root.file, nodes[0].line))
    return rotors


def _with(owner: XmlNode, stated: Rotor, notes: list[str]) -> Rotor:
    """Return a rotor with what an element states and the rotor does not; note what both state otherwise."""
    more = read_rotor(owner, notes)
    out = more | stated
    for word, value in more.items():
        if out[word] != value and out.get("rotor_inertia"):
            what = f"{word.replace('_', ' ')} {value:g} of {owner.label}"
            notes.append(f"{owner.at}: {DROPS} the {what}: another place states {out[word]:g}")
    return out


def behind(rotor: Rotor, joint: Joint, root: XmlNode, notes: list[str]) -> Joint:
    """Return a joint with the rotor of its transmissions; note other numbers that the joint itself states."""
    inertia, ratio = rotor.get("rotor_inertia", 0.0), rotor.get("gear_ratio", joint.gear_ratio)
    other_inertia = inertia and joint.rotor_inertia not in (0.0, inertia)
    for word, own, other, differs in (
        ("rotor inertia", joint.rotor_inertia, inertia, other_inertia),
        ("gear ratio", joint.gear_ratio, ratio, joint.gear_ratio not in (1.0, ratio)),
    ):
        if differs:
            what = f"{DROPS} the {word} {own:g} of joint '{joint.name}'"
            notes.append(f"{root.file}:{joint.line}: {what}: a transmission states {other:g}")
    return replace(joint, **rotor)


def _added(node: XmlNode, name: str, first: Rotor, other: Rotor, notes: list[str]) -> Rotor:
    """Return the rotor of a joint with that of a further transmission: their inertias at the joint add."""
    if not other.get("rotor_inertia"):
        return other | first
    if not first.get("rotor_inertia"):
        return first | other
    ratio = first.get("gear_ratio", 1.0)
    inertia = first["rotor_inertia"] + other["rotor_inertia"] * (other.get("gear_ratio", 1.0) / ratio) ** 2
    notes.append(
        f"{node.at}: joint '{name}' has rotors in several transmissions: their inertias at the joint add; "
        "Drake counts the last one alone"
    )
    return first | {"rotor_inertia": inertia}


def _share_rotors(node: XmlNode, joints: list[XmlNode], rotors: dict[str, Rotor], robot: RobotFile) -> None:
    """Give two joints the inertia of the rotors that turn with both; note rotors that nothing can express.

    Rotor i turns by n_i (c_i1 q_1 + c_i2 q_2), with n_i the reduction of its actuator. With the reductions
    n_1, n_2 of the joints, c is ((n_1, n_2), (n_1, -n_2)) in a DifferentialTransmission, and ((n_1, 0),
    (1, n_2)) in a FourBarLinkageTransmission. Where J n_i^2 of both rotors of a differential are equal, the
    inertia 2 J n_i^2 stands behind the reduction of each joint. Other rotors become joints, which follow.

    Source: transmission_interface of ros_control, the maps of positions.
    """
    owners = [*node.children("actuator"), node]
    stated = [
        (owner, rotor) for owner in owners if (rotor := read_rotor(owner, robot.notes)).get("rotor_inertia")
    ]
    if not stated:
        return
    kind = node.child("type")
    words = f"{node.attrib.get('type', '')} {kind.content() if kind else ''}"
    names = [joint.text("name") for joint in _by_role(joints)]
    ratios = [rotors[name].get("gear_ratio", 1.0) for name in names]
    maps = {word: of(*ratios) for word, of in ROTOR_MAPS.items() if word in words and len(joints) == 2}
    own = any(rotors[name].get("rotor_inertia") for name in names)
    if own or not maps or len(owners) != 3 or stated[-1][0] is node:
        told = listed(owner.attrib.get("name", owner.tag) for owner, _ in stated)
        robot.notes.append(
            f"{node.at}: {DROPS} the rotors of {told}: "
            "they couple joints; state their inertia in the <joint>s of the <transmission>, or in model.toml"
        )
        return
    at_joint = [rotor["rotor_inertia"] * rotor.get("gear_ratio", 1.0) ** 2 for _, rotor in stated]
    ((word, map_),) = maps.items()
    if word == "Differential" and len(stated) == 2 and math.isclose(*at_joint):
        for name in names:
            rotors[name]["rotor_inertia"] = sum(at_joint)
        return
    rows = dict(zip((owner.text("name") for owner in _by_role(owners[:2])), map_, strict=True))
    for owner, rotor in stated:
        _add_rotor(owner, rotor, dict(zip(names, rows[owner.text("name")], strict=True)), robot)


#: Turns of the two rotors, before their own reductions, per turn of the two joints, by the type.
ROTOR_MAPS: dict[str, Callable[[float, float], tuple[tuple[float, float], tuple[float, float]]]] = {
    "Differential": lambda first, second: ((first, second), (first, -second)),
    "FourBar": lambda first, second: ((first, 0.0), (1.0, second)),
}


def _by_role(nodes: list[XmlNode]) -> list[XmlNode]:
    """Return two joints or actuators in the order of their roles ("joint1"), or of the file without them."""
    roles = {id(node.xml): role.content() for node in nodes if (role := node.child("role"))}
    return sorted(nodes, key=lambda node: roles.get(id(node.xml), "")[-1:])


def _add_rotor(owner: XmlNode, rotor: Rotor, rates: dict[str, float], robot: RobotFile) -> None:
    """Add a rotor as a joint with the name of its actuator, which follows the joints.

    Args:
        owner: The actuator.
        rotor: Inertia and reduction.
        rates: Turns before the reduction per turn of each joint.
        robot: The robot.
    """
    carrier = next((joint.parent for joint in robot.joints if joint.name in rates), None)
    if carrier is None:  # `choose_motors` notes that there is no such joint
        return
    name = unique(owner.text("name"), {joint.name for joint in robot.joints})
    link = unique(name, {link.name for link in robot.links})
    robot.links.append(massless(link, owner.line, between=True))
    robot.joints.append(
        Joint(
            name, JointKind.CONTINUOUS, carrier, link, np.eye(4), np.array([0.0, 0.0, 1.0]),
            rotor_inertia=rotor["rotor_inertia"], line=owner.line,
        )
    )  # fmt: skip
    ratio = rotor.get("gear_ratio", 1.0)
    terms = tuple((joint, -ratio * rate) for joint, rate in rates.items() if rate)
    robot.couplings.append(Coupling(name, ((name, 1.0), *terms), 0.0, owner.line))


def _number(child: XmlNode, notes: list[str]) -> float | None:
    """Return the number of an element of a rotor, or None for a reduction that is no number and none needs.

    Raises:
        ModelError: The text is no number, and the file states inertia of rotors.
    """
    try:
        return child.number("value") if "value" in child.attrib else child.number()
    except ModelError:
        root = XmlNode(child.xml.getroottree().getroot(), child.file)
        inertias = [tag for tag, word in ROTOR_TAGS.items() if word == "rotor_inertia"]
        if ROTOR_TAGS[child.tag] == "rotor_inertia" or [*root.descendants(*inertias)]:
            raise
    notes.append(
        f"{child.at}: <{child.tag}> '{child.content()[:40]}' is no number; no rotor needs it, and PyBullet "
        "reads none"
    )
    return None


def read_rotor(node: XmlNode, notes: list[str]) -> Rotor:
    """Read a rotor from the direct children of an element, with numbers as `value` attributes or as text.

    Args:
        node: The element.
        notes: Takes numbers that are dropped because others state the same otherwise.

    Returns:
        Inertia about its own axis [kg m^2] and turns per turn of the joint, as fields of `records.Joint`,
        where they are stated.

    Raises:
        ModelError: A number does not parse, the inertia is negative, or the ratio is zero.
    """
    out: Rotor = {}
    order = [*ROTOR_TAGS]
    for child in sorted(node.children(*ROTOR_TAGS), key=lambda child: order.index(child.tag)):
        word = ROTOR_TAGS[child.tag]
        value = _number(child, notes)
        if value is None:
            continue
        if word == "rotor_inertia" and value < 0:
            raise child.error(f"negative rotor inertia {value:g}")
        if word == "gear_ratio" and value == 0:
            raise child.error("a gear ratio of 0 moves nothing")
        if out.setdefault(word, value) != value and (word, value) != ("gear_ratio", 1.0):
            notes.append(f"{child.at}: {DROPS} <{child.tag}> {value:g}: another element states {out[word]:g}")
    return out
