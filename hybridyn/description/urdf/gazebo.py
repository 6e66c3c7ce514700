"""Read what the `<gazebo>` blocks of a URDF state about the motion, and the followers of ros2_control.

Joints in `<gazebo>` are SDF: `<parent>` and `<child>` name links, `<pose>` places the joint in the child's
frame, and the loop is closed where all joints are at zero, because SDF places its links in this posture. A
DetachableJoint welds two links as they stand there. Mimic plugins and `<param name="mimic">` couple joints.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..closure_forms import FORMS, LARGEST_COSINE, closure_of
from ..loop_signs import ACCEPTED_FORMS
from ..names import DROPS, did_you_mean, unique
from ..placement import placement_from, poses_at_zero, relative, rotation_from_rpy, rotation_to_axis
from ..plugins import Follower, followers, refuse_holding, weld_of
from ..records import Array, Coupling, RobotFile, StatedSpring
from ..sdf.elements import flag, numbers
from .control import followers_of_control
from .kept_joints import keep_joint
from .loops import kind_of
from .xml_node import Node, unit

#: Types of SDF joints by the kind of closure.
GAZEBO_TYPES = {
    "fixed": "fixed", "revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic",
    "ball": "spherical", "universal": "universal",
}  # fmt: skip
MODEL = "__model__"
OBLIQUE = "the axes of a universal joint are perpendicular; mend them, or write two revolute joints"
GAZEBO_PARTS = (
    "parent",
    "child",
    "pose",
    "axis",
    "axis2",
    "physics",
    "sensor",
    "gearbox_ratio",
    "thread_pitch",
)


def read_gazebo(root: Node, robot: RobotFile) -> None:
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
    poses = poses_at_zero(robot.joints) | {MODEL: np.eye(4)} if nodes or welds else {}
    for node in nodes:
        _read_joint(node, poses, robot)
    for plugin, ends in welds:
        _weld(plugin, ends, poses, robot)
    for plugin in plugins:
        if weld_of(plugin, robot.name) is None:
            refuse_holding(plugin, links, f"a{ACCEPTED_FORMS[1:]}")
    for follower in (*(one for plugin in plugins for one in followers(plugin)), *followers_of_control(root)):
        _couple(follower, robot)
    _read_springs(blocks, robot)


def _weld(plugin: Node, ends: tuple[Node, Node], poses: Mapping[str, Array], robot: RobotFile) -> None:
    """Add the weld of a DetachableJoint: the two links keep the place that they have at zero."""
    parent, child = (_link(end, poses) for end in ends)
    name = unique(f"weld_{parent}_{child}", {closure.name for closure in robot.closures})
    sides = (parent, relative(poses[parent], poses[child])), (child, np.eye(4))
    robot.closures.append(closure_of(name, "fixed", sides, line=plugin.line))


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


def _read_springs(blocks: list[Node], robot: RobotFile) -> None:
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


def _reference(block: Node) -> str:
    return str(block.xml.get("reference", ""))


def _read_joint(node: Node, poses: Mapping[str, Array], robot: RobotFile) -> None:
    kind = GAZEBO_TYPES[
        kind_of(node, GAZEBO_TYPES, "an SDF joint of type '{}' closes no loop here; write it as <loop>")
    ]
    node.only(["name", "type"], GAZEBO_PARTS)
    links = [_link(node.required_child(end), poses) for end in ("parent", "child")]
    at_child, at = node.child("pose"), poses[links[1]]
    if at_child is not None:
        at_child.only(["relative_to", "frame"], [])
        frame = at_child.xml.get("relative_to") or at_child.xml.get("frame") or links[1]
        place = at_child.numbers("", 6) if at_child.content() else np.zeros(6)
        at = _frame(at_child, frame, poses) @ placement_from(rotation_from_rpy(*place[3:]), place[:3])
    tags = {"universal": ("axis", "axis2")}.get(kind, ("axis",) if FORMS[kind].has_axis else ())
    axes = [node.required_child(tag) for tag in tags]
    directions, forces = [_direction(axis, at, poses) for axis in axes], dict[str, float]()
    if len(axes) == 2 and abs(directions[0] @ directions[1]) > LARGEST_COSINE:
        raise node.error(OBLIQUE)
    for axis in axes:
        forces |= {
            word: value for word, value in numbers(axis.child("dynamics"), "dynamics").items() if value
        }
        if axis.child("limit"):
            robot.notes.append(f"closure '{node.text('name')}': 'limit' of the SDF joint is not read")
    turns = [rotation_to_axis(direction) for direction in directions] or [np.eye(3)]
    sides = [(link, relative(poses[link], at)) for link in links]
    closure = closure_of(node.text("name"), kind, sides, (turns[0], turns[-1]), line=node.line)
    keep_joint(robot, closure, forces, poses, node)


def _link(node: Node, poses: Mapping[str, Array]) -> str:
    """Return the link that an end of the joint names."""
    node.only([], [])
    name = node.content()
    if name == "world" and name not in poses:
        raise node.error(
            "a joint to the world closes no loop of the robot; name a link (the root link stands still on a "
            "fixed base)"
        )
    if name not in poses or name == MODEL:
        raise node.error(f"unknown link '{name}'{did_you_mean(name, poses)}")
    return name


def _direction(node: Node, at: Array, poses: Mapping[str, Array]) -> Array:
    """Return the unit axis in the joint's frame, shape (3,)."""
    xyz, value, frame = node.child("xyz"), np.array([0.0, 0.0, 1.0]), ""
    if xyz is not None:
        value, frame = unit(xyz, xyz.numbers("", 3), "<xyz>0 0 1</xyz>"), xyz.xml.get("expressed_in", "")
    if flag(node, "use_parent_model_frame"):
        frame = MODEL
    return at[:3, :3].T @ _frame(node, frame, poses)[:3, :3] @ value if frame else value


def _frame(node: Node, name: str, poses: Mapping[str, Array]) -> Array:
    if name not in poses:
        raise node.error(f"unknown frame '{name}'{did_you_mean(name, poses)}; name a link, or {MODEL}")
    return poses[name]
