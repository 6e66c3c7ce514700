"""Read the motors of a URDF from `<transmission>`, with gear ratio and rotor inertia of simple ones."""

from __future__ import annotations

from typing import Any

from ..names import listed
from ..robot_file import MotorStatement, RobotFile
from .xml_node import Node

JOINT_TAGS = ("joint", "flexJoint", "rollJoint")
#: Elements that state the rotor of a motor, and the field of `records.Joint`.
ROTOR_TAGS = {
    "rotor_inertia": "rotor_inertia", "drake:rotor_inertia": "rotor_inertia", "rotorInertia": "rotor_inertia",
    "gear_ratio": "gear_ratio", "drake:gear_ratio": "gear_ratio", "mechanicalReduction": "gear_ratio",
}  # fmt: skip


def read_transmissions(
    root: Node, robot: RobotFile
) -> tuple[MotorStatement | None, dict[str, dict[str, Any]]]:
    """Read every `<transmission>`; its joints are driven, except fixed joints.

    Returns:
        The list of motors (None if no transmission names a joint), and the rotors by joint name. For a
        transmission with several joints or actuators, only the values inside its `<joint>` elements count.
    """
    nodes = root.children("transmission")
    rotors: dict[str, dict[str, Any]] = {}
    for node in nodes:
        joints, actuators = node.children(*JOINT_TAGS), node.children("actuator")
        if not joints:
            robot.notes.append(f"{node.label} ({node.where}) names no <joint> and drives nothing")
        for joint in joints:
            name = joint.text("name")
            rotors[name] = rotors.get(name, {}) | read_rotor(joint)
        if len(joints) == 1 and len(actuators) <= 1:
            for owner in (*actuators, node):
                rotors[name] = read_rotor(owner) | rotors[name]
    if not rotors:
        return None, {}
    fixed = [joint.name for joint in robot.joints if joint.kind == "fixed" and joint.name in rotors]
    if fixed:
        robot.notes.append(f"<transmission> names fixed joints, which cannot be driven: {listed(fixed)}")
    driven = tuple(name for name in rotors if name not in fixed)
    statement = MotorStatement("transmission", "URDF <transmission>", driven, root.file, nodes[0].line)
    return statement, rotors


def read_rotor(node: Node) -> dict[str, Any]:
    """Read a rotor from the direct children of an element, with numbers as `value` attributes or as text.

    Returns:
        Inertia about its own axis [kg m^2] and turns per turn of the joint, as fields of `records.Joint`,
        where they are stated.

    Raises:
        ModelError: A number does not parse, the inertia is negative, or the ratio is zero.
    """
    out: dict[str, Any] = {}
    for child in node.children(*ROTOR_TAGS):
        word = ROTOR_TAGS[child.tag]
        value = child.number("value") if "value" in child.xml.attrib else child.content_number()
        if word == "rotor_inertia" and value < 0:
            raise child.error(f"negative rotor inertia {value:g}")
        if word == "gear_ratio" and value == 0:
            raise child.error("a gear ratio of 0 moves nothing")
        out.setdefault(word, value)
    return out
