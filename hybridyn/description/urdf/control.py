"""Read what `<ros2_control>` of a URDF states of the robot: joints that follow others, and driven joints.

A joint with a `<command_interface>` is driven; one that has only state interfaces is measured. What moves
with another joint follows by the `<mimic>` of the URDF, or by `<param name="mimic">`.
"""

from __future__ import annotations

from collections.abc import Iterator

from ..names import listed
from ..plugins import Follower
from ..records import MotorStatement, RobotFile
from .xml_node import XmlNode

TAG = "ros2_control"


def followers_of_control(root: XmlNode) -> Iterator[Follower]:
    """Yield the joints that ros2_control moves with others by `<param name="mimic">`."""
    for joint in _joints(root):
        stated = {str(param.attrib.get("name")): param for param in joint.children("param")}
        if "mimic" in stated:
            numbers = (
                stated[word].number() if word in stated else default
                for word, default in (("multiplier", 1.0), ("offset", 0.0))
            )
            yield Follower(joint, joint.text("name"), stated["mimic"].content(), *numbers)


def state_interfaces(root: XmlNode, robot: RobotFile) -> None:
    """Add the joints with a command interface to the motors, and note what the blocks say of followers.

    The motors have the order of the joints of the robot.
    """
    followers = {coupling.name for coupling in robot.couplings}
    freedoms = {joint.name: joint.kind.nv for joint in robot.joints}
    driven: dict[str, XmlNode] = {}
    for node in _joints(root):
        name, mimic = node.text("name"), node.attrib.get("mimic", "").strip().lower()
        if mimic == "false" and name in followers:
            _note(robot, node, f"joint '{name}' says mimic=\"false\"; it follows by its <mimic> here")
        if mimic == "true" and name in freedoms and name not in followers:
            _note(robot, node, f"joint '{name}' says mimic=\"true\", but follows no joint")
        if node.children("command_interface"):
            driven[name] = node
    unknown = [name for name in driven if name not in freedoms]
    if unknown:
        _note(
            robot, driven[unknown[0]], f"it commands joints that the robot does not have: {listed(unknown)}"
        )
    names = [name for name, n in freedoms.items() if name in driven and n == 1 and name not in followers]
    if names:
        node = driven[names[0]]
        where = "command interfaces of <ros2_control>"
        robot.motors.append(MotorStatement("interface", where, tuple(names), root.file, node.line))


def _joints(root: XmlNode) -> Iterator[XmlNode]:
    """Yield the joints of the blocks."""
    for block in root.children(TAG):
        yield from block.children("joint")


def _note(robot: RobotFile, node: XmlNode, text: str) -> None:
    robot.notes.append(f"{node.at}: <{TAG}>: {text}")
