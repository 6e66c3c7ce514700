"""Read the motors of a URDF from `<transmission>`, with gear ratio and rotor inertia of simple ones."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

from ..names import listed
from ..records import Joint
from ..robot_file import MotorStatement, RobotFile
from .xml_node import Node

JOINT_TAGS = ("joint", "flexJoint", "rollJoint")
INERTIA_TAGS = ("rotor_inertia", "drake:rotor_inertia", "rotorInertia")
RATIO_TAGS = ("gear_ratio", "drake:gear_ratio", "mechanicalReduction")


class Rotor(NamedTuple):
    """The values that a file states for the rotor of a motor.

    Attributes:
        inertia: Inertia about its own axis [kg m^2], or None if not stated.
        ratio: Rotor turns per joint turn, or None if not stated.
    """

    inertia: float | None = None
    ratio: float | None = None

    def over(self, weaker: Rotor) -> Rotor:
        """Return this rotor, with missing values taken from `weaker`."""
        return Rotor(
            weaker.inertia if self.inertia is None else self.inertia,
            weaker.ratio if self.ratio is None else self.ratio,
        )

    def put_into(self, joint: Joint) -> Joint:
        """Return the joint with the values of this rotor; missing values leave those of the joint."""
        return replace(
            joint,
            rotor_inertia=joint.rotor_inertia if self.inertia is None else self.inertia,
            gear_ratio=joint.gear_ratio if self.ratio is None else self.ratio,
        )


def read_transmissions(root: Node, robot: RobotFile) -> tuple[MotorStatement | None, dict[str, Rotor]]:
    """Read every `<transmission>`; its joints are driven, except fixed joints.

    Returns:
        The list of motors (None if no transmission names a joint), and the rotors by joint name. For a
        transmission with several joints or actuators, only the values inside its `<joint>` elements count.
    """
    nodes = root.children("transmission")
    rotors: dict[str, Rotor] = {}
    for node in nodes:
        joints, actuators = node.children(*JOINT_TAGS), node.children("actuator")
        if not joints:
            robot.notes.append(f"{node.label} ({node.where}) names no <joint> and drives nothing")
        for joint in joints:
            name = joint.text("name")
            rotors[name] = read_rotor(joint).over(rotors.get(name, Rotor()))
        if len(joints) == 1 and len(actuators) <= 1:
            name = joints[0].text("name")
            for owner in (*actuators, node):
                rotors[name] = rotors[name].over(read_rotor(owner))
    if not rotors:
        return None, {}
    fixed = [joint.name for joint in robot.joints if joint.kind == "fixed" and joint.name in rotors]
    if fixed:
        robot.notes.append(f"<transmission> names fixed joints, which cannot be driven: {listed(fixed)}")
    driven = tuple(name for name in rotors if name not in fixed)
    statement = MotorStatement("transmission", "URDF <transmission>", driven, root.file, nodes[0].line)
    return statement, rotors


def read_rotor(node: Node) -> Rotor:
    """Read a rotor from the direct children of an element, with numbers as `value` attributes or as text.

    Raises:
        ModelError: A number does not parse, the inertia is negative, or the ratio is zero.
    """
    rotor = Rotor()
    for child in node.children(*INERTIA_TAGS, *RATIO_TAGS):
        value = child.number("value") if "value" in child.xml.attrib else child.content_number()
        if child.tag in INERTIA_TAGS:
            if value < 0:
                raise child.error(f"negative rotor inertia {value:g}")
            rotor = rotor.over(Rotor(inertia=value))
        else:
            if value == 0:
                raise child.error("a gear ratio of 0 moves nothing")
            rotor = rotor.over(Rotor(ratio=value))
    return rotor
