"""Read what the `<gazebo>` blocks of a URDF state about the motion, and the followers of ros2_control.

Joints are read by `gazebo_joints`. A DetachableJoint welds two links as they stand where all joints are at
zero. Mimic plugins and `<param name="mimic">` couple joints.
"""

from __future__ import annotations

from ..loop_signs import ACCEPTED_FORMS
from ..names import DROPS, did_you_mean
from ..plugins import Follower, followers, refuse_holding, weld_of
from ..records import Coupling, RobotFile, StatedSpring
from .control import followers_of_control
from .xml_node import XmlNode


def read_gazebo(root: XmlNode, robot: RobotFile) -> None:
    """Add the joints, welds, followers and springs of the blocks to the robot.

    Raises:
        ModelError: A joint has a type that closes no loop here, names what does not exist, or a link or a
            plugin holds parts of the robot in a form that is not read.
    """
    blocks = root.children("gazebo")
    whole = [block for block in blocks if "reference" not in block.attributes()]
    links = {link.name for link in robot.links}
    nodes = [joint for block in whole for joint in block.children("joint")]
    plugins = [
        plugin for block in (root, *blocks) for plugin in block.children("plugin")
    ]  # those of sensors measure
    welds = [(plugin, ends) for plugin in plugins if (ends := weld_of(plugin, robot.name))]
    if nodes or welds:
        from .gazebo_joints import read_gazebo_joints  # it takes the reader of SDF, as few URDFs do

        read_gazebo_joints(nodes, welds, robot)
    for plugin in plugins:
        if weld_of(plugin, robot.name) is None:
            refuse_holding(plugin, links, f"a{ACCEPTED_FORMS[1:]}")
    for follower in (*(one for plugin in plugins for one in followers(plugin)), *followers_of_control(root)):
        _couple(follower, robot)
    _read_springs(blocks, robot)


def _couple(follower: Follower, robot: RobotFile) -> None:
    """Add the coupling of a follower, unless the joint itself states one."""
    node, name, leader = follower.node, follower.name, follower.leader
    movable = {joint.name: joint.kind.nv for joint in robot.joints if joint.kind.nv}
    coupling = Coupling(name, ((name, 1.0), (leader, -follower.multiplier)), follower.offset, node.line)
    same = [one for one in robot.couplings if one.name == name]
    if name not in movable:
        return  # it was cut away or made rigid
    if same and (same[0].terms, same[0].offset) == (coupling.terms, coupling.offset):
        return
    reason = ""
    if same:
        reason = "the joint follows in another way by its <mimic>"
    elif movable.get(name) != 1 or movable.get(leader) != 1 or name == leader:
        reason = f"the robot has no two such joints with one freedom{did_you_mean(leader, movable)}"
    if reason:
        robot.notes.append(f"{node.at}: {DROPS} the mimic of joint '{name}' after '{leader}': {reason}")
    else:
        robot.couplings.append(coupling)


def _read_springs(blocks: list[XmlNode], robot: RobotFile) -> None:
    """Add the springs that blocks state for joints; of several statements the last counts, as in Gazebo."""
    rests = {_reference(block): rest for block in blocks if (rest := block.child("springReference"))}
    for block in blocks:
        stiffness, name = block.child("springStiffness"), _reference(block)
        if stiffness is None or not stiffness.number():
            continue
        if stiffness.number() < 0:
            raise stiffness.error(f"negative stiffness {stiffness.number():g} of joint '{name}'")
        joint = next((joint for joint in robot.joints if joint.name == name), None)
        if joint is None or not joint.kind.single:
            robot.notes.append(
                f"{stiffness.at}: {DROPS} the spring of '{name}', which is no joint with one freedom"
            )
            continue
        spring = StatedSpring(name, stiffness.number(), rests[name].number() if name in rests else 0.0)
        robot.notes += [
            f"{stiffness.at}: {DROPS} the stiffness {other.stiffness:g} that an earlier place states for "
            f"joint '{name}': the last one counts, as in Gazebo"
            for other in robot.springs if other.name == name and other.stiffness != spring.stiffness
        ]  # fmt: skip
        robot.springs[:] = [*(other for other in robot.springs if other.name != name), spring]


def _reference(block: XmlNode) -> str:
    return block.attrib.get("reference", "")
