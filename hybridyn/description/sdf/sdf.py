"""Read an SDF file: one model, with the files that it includes, becomes records.

A link has SDFormat's defaults: without `<inertial>` it weighs 1 kg. A joint has its type, links, pose and
axes in the world, numbers and leaders. Forces and joints that hybridyn does not have are errors. Plugins,
sensors and shapes are not read.
"""

from __future__ import annotations

import math
import os
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..closure_forms import FORMS, LARGEST_COSINE, closure_of
from ..joint_graph import WORLD, Chain, JointGraph, StatedJoint, span, starts, step
from ..names import did_you_mean, listed, noted, unique
from ..placement import inverse, placement_from, rotation_to_axis
from ..plugins import refuse_holding, weld_of
from ..records import Array, Closure, Coupling, Joint, JointKind, Link, RobotFile, StatedSpring, spring_effect
from ..urdf.xml_node import Node
from .elements import Notes, direction, flag, numbers, pose, relative_to, word
from .models import Item, Library, Models

#: Largest limit that is one: SDFormat's defaults before version 1.9 are -1e16 and 1e16.
UNLIMITED = 1e16

#: How many axes each type of joint has.
AXES = {
    "fixed": 0, "ball": 0, "revolute": 1, "continuous": 1, "prismatic": 1, "universal": 2,
}  # fmt: skip

#: Types of joints that are not read, and what to write in their place.
UNREAD = {
    "screw": "a revolute and a prismatic joint, and <mimic> in one of them",
    "gearbox": "<mimic> in the axis of one of its joints",
    "revolute2": "two revolute joints with a link between them",
    "piston": "a revolute and a prismatic joint; programs never agreed on its meaning",
}

#: Importance of a joint whose position something needs: a loop is cut beside it, not at it.
NEEDED = 4

#: What is noted of links and joints.
ASSUMED = "{}: no mass or inertia is stated, so SDFormat's default counts (1 kg, 1 kg m^2 about each axis)"
ENDLESS_LIMITS = "limits of position of continuous joints {} are ignored, as Gazebo and Drake do"
IDLE = "joints {}: an axis that the joint does not have, and its dynamics, are ignored, as Gazebo does"


def read_link(item: Item, file: str, notes: Notes) -> Link:
    """Return a link; note SDFormat's default inertia.

    Args:
        item: The element.
        file: The robot's own file.
        notes: Takes what is noted.

    Raises:
        ModelError: A number is invalid, or a link states forces that hybridyn does not have.
    """
    node = item.node
    if not flag(node, "gravity", True):
        raise node.error("<gravity>false</gravity> is not read; remove it, or load the robot without gravity")
    if flag(node, "kinematic"):
        raise node.error("a program moves a kinematic link; remove <kinematic>")
    decay = node.child("velocity_decay")
    if decay is not None and any(numbers(decay, "velocity_decay").values()):
        raise decay.error("damping of a link's speed is not read; set it to 0, or put damping on joints")
    inertial = node.child("inertial")
    tensor = at = None
    if inertial is not None:
        _refuse_unread(inertial)
        tensor, at = inertial.child("inertia"), inertial.child("pose")
    if inertial is None or tensor is None or not word(inertial, "mass"):
        notes.setdefault(ASSUMED, []).append(item.full_name)
    ixx, ixy, ixz, iyy, iyz, izz = numbers(tensor, "inertia").values()
    placement = pose(at)
    turn = placement[:3, :3]
    inertia = turn @ np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]]) @ turn.T
    mass = numbers(inertial, "inertial")["mass"]
    return Link(item.full_name, mass, placement[:3, 3], (inertia + inertia.T) / 2, _line(node, file))


def _refuse_unread(inertial: Node) -> None:
    """Refuse inertia that a program computes, and that of displaced fluid."""
    if inertial.flag("auto", False):
        raise inertial.error(
            'auto="true": inertia of shapes is not computed; write <mass>, <pose> and <inertia>'
        )
    if frame := relative_to(inertial.child("pose")):
        raise inertial.error(f"its pose is relative to '{frame}'; SDFormat has it in the link's frame")
    added = inertial.child("fluid_added_mass")
    if added is not None and any(child.number() for child in added.children() if child.content()):
        raise added.error("the inertia of displaced fluid is not read; remove it")


def _line(node: Node, file: str) -> int | None:
    """Return the line of an element in the robot's own file, None in another one."""
    return node.line if node.file == file else None


@dataclass(frozen=True, eq=False)
class Axis:
    """An axis of a joint.

    Attributes:
        direction: Unit vector in the world, shape (3,).
        numbers: Limits and friction, as in `records.Joint`; the lower limit may be above the upper one.
        spring: Stiffness of its spring [N/m or N m/rad], and its position without force [m or rad].
        initial: Position at the start [m or rad], nan if not stated.
        mimic: The element `<mimic>`, and the joint that it follows, or None.
    """

    direction: Array
    numbers: dict[str, float]
    spring: tuple[float, float]
    initial: float
    mimic: tuple[Node, Item] | None

    @property
    def limited(self) -> bool:
        """Whether it has any limit."""
        return any(math.isfinite(self.numbers[word]) for word in ("lower", "upper", "velocity", "effort"))

    @property
    def needed(self) -> bool:
        """Whether its position matters: damping, friction, a spring, a leader or a start depends on it."""
        forces = self.numbers["damping"], self.numbers["friction"], self.spring[0]
        return any(forces) or self.mimic is not None or not math.isnan(self.initial)


@dataclass(frozen=True, eq=False)
class Stated(StatedJoint):
    """A joint as its file states it.

    Attributes:
        item: The element.
        kind: Its type.
        links: Parent and child link, None for the world.
        at: Pose of the joint in the world, shape (4, 4).
        axes: Its axes.
        rotor: Rotor inertia [kg m^2] and gear ratio, as in `records.Joint`.
    """

    item: Item
    kind: str
    links: tuple[Item | None, Item | None]
    at: Array
    axes: list[Axis]
    rotor: dict[str, float]

    def importance(self, leaders: Collection[Item]) -> int:
        """Return how much would be lost if it were only a closure. `leaders`: joints that others follow."""
        if self.kind == "fixed":
            return NEEDED + 1
        if self.rotor["rotor_inertia"] or self.item in leaders or any(axis.needed for axis in self.axes):
            return NEEDED
        if any(axis.limited for axis in self.axes):
            return 3
        return 1 if self.kind == "ball" else 2


def read_joints(models: Models, file: str, notes: Notes) -> list[Stated]:
    """Return the joints in the order of the file.

    Args:
        models: Where everything stands.
        file: The robot's own file.
        notes: Takes what is noted.

    Raises:
        ModelError: The type is not read, a link or axis is missing, or a number is invalid.
    """
    joints = [_read_joint(item, models, file, notes) for item in models.every("joint")]
    leaders = {axis.mimic[1] for joint in joints for axis in joint.axes if axis.mimic is not None}
    importance = {joint: joint.importance(leaders) for joint in joints}
    children, out = {WORLD}, {}
    for joint in sorted(joints, key=lambda joint: (joint.closes, -importance[joint])):
        rank = joint.closes, -importance[joint], joint.ends[1] in children
        needed = importance[joint] == NEEDED
        out[joint] = replace(joint, rank=rank, needed=needed)
        children.add(joint.ends[1])
    return [out[joint] for joint in joints]


def _read_joint(item: Item, models: Models, file: str, notes: Notes) -> Stated:
    node, kind = item.node, item.node.text("type")
    if kind in UNREAD:
        raise node.error(f"type '{kind}' is not read; write {UNREAD[kind]}")
    if kind not in AXES:
        raise node.error(f"unknown joint type '{kind}'{did_you_mean(kind, AXES)}; known: {listed(AXES)}")
    ends = [node.required_child(tag) for tag in ("parent", "child")]
    parent, child = (models.link(item.scope, end.content(), end) for end in ends)
    if parent is child:
        what = "the world" if parent is None else f"link '{parent.full_name}'"
        raise node.error(f"joins {what} to itself")
    axes = []
    for number, tag in enumerate(("axis", "axis2")):
        axis = node.child(tag)
        if number < AXES[kind]:
            if axis is None:
                raise node.error(f"<{tag}> is missing; a {kind} joint has {AXES[kind]}")
            axes.append(_read_axis(axis, item, models))
        elif axis is not None and axis.child("mimic") is not None:
            raise axis.error(f"<mimic> in an axis that a {kind} joint does not have; remove it")
        elif axis is not None:
            notes.setdefault(IDLE, []).append(item.full_name)
    if kind == "universal" and abs(axes[0].direction @ axes[1].direction) > LARGEST_COSINE:
        raise node.error(
            "the axes of a universal joint are perpendicular; mend them, or write two revolute joints"
        )
    if kind == "continuous" and any(math.isfinite(axes[0].numbers[word]) for word in ENDLESS):
        notes.setdefault(ENDLESS_LIMITS, []).append(item.full_name)
    first, second = (WORLD if end is None else end.full_name for end in (parent, child))
    return Stated(
        item.full_name, (first, second), (), _line(node, file), _must_close(item), False, item, kind,
        (parent, child), models.pose(item), axes, _rotor(node, kind),
    )  # fmt: skip


def _must_close(item: Item) -> bool:
    """Return whether Simbody's setting asks that a joint closes a loop."""
    physics = item.node.child("physics")
    simbody = physics and physics.child("simbody")
    return simbody is not None and flag(simbody, "must_be_loop_joint")


def _rotor(node: Node, kind: str) -> dict[str, float]:
    inertia, ratio = numbers(node, "joint").values()
    if inertia and kind in ("ball", "universal"):
        raise node.error(
            f"<drake:rotor_inertia> of {inertia:g} kg m^2 does not say which axis of a {kind} joint the "
            "rotor turns with; write revolute joints, with the rotor in one of them"
        )
    if ratio == 0:
        raise node.error("a gear ratio of 0 moves nothing")
    return {"rotor_inertia": inertia, "gear_ratio": ratio}


def _read_axis(node: Node, item: Item, models: Models) -> Axis:
    xyz = node.child("xyz")
    if xyz is None:
        raise node.error("<xyz> is missing; give a direction such as <xyz>0 0 1</xyz>")
    local, frame = direction(xyz), str(xyz.xml.get("expressed_in", "")).strip()
    if item.minor >= 7 and node.child("use_parent_model_frame") is not None:
        raise node.error(
            'use_parent_model_frame ended with SDFormat 1.6; write <xyz expressed_in="__model__">'
        )
    place: Item | None = item
    if frame:
        place = models.resolve(item.scope, frame, xyz)
    elif flag(node, "use_parent_model_frame", default=item.minor < 5):
        place = item.scope
    mimic, forces = node.child("mimic"), numbers(node.child("dynamics"), "dynamics")
    return Axis(
        models.pose(place)[:3, :3] @ local,
        _limits(node.child("limit")) | {word: forces[word] for word in ("damping", "friction")},
        (forces["spring_stiffness"], forces["spring_reference"]), numbers(node, "axis")["initial_position"],
        None if mimic is None else (mimic, _leader(mimic, item, models)),
    )  # fmt: skip


def _limits(node: Node | None) -> dict[str, float]:
    """Return position, speed and effort limits; negative speed and effort limits mean none in SDFormat."""
    stated = numbers(node, "limit")
    out = {tag: math.inf if stated[tag] < 0 else stated[tag] for tag in ("velocity", "effort")}
    out |= {tag: stated[tag] for tag in ("lower", "upper")}
    return {tag: math.copysign(math.inf, x) if abs(x) >= UNLIMITED else x for tag, x in out.items()}


def _leader(mimic: Node, item: Item, models: Models) -> Item:
    """Return the joint that an axis follows."""
    name = mimic.text("joint")
    leader = models.find(item.scope, name).get("joint")
    if leader is None:
        known = [joint.name for joint in models.every("joint") if joint.scope is item.scope]
        raise mimic.error(f"unknown joint '{name}'{did_you_mean(name, known)}; known: {listed(known)}")
    return leader


#: Gravity of a world that states none [m/s^2].
GRAVITY = (0.0, 0.0, -9.8)

#: What is noted of the tree.
FLOATS = (
    "nothing joins the model to the world, so its base floats; to hold it, load it with base='fixed', or "
    "write a fixed joint with <parent>world</parent>"
)
CLOSED = (
    "limits of closures are not read: {}; to keep them, cut another joint of the loop "
    "(<physics><simbody><must_be_loop_joint>true)"
)

#: Kinds of joints by type; those of several axes are chains.
KINDS: dict[str, JointKind] = {
    "revolute": "revolute", "continuous": "continuous", "prismatic": "prismatic",
    "universal": "revolute",
}  # fmt: skip

#: Limits of an endless joint, whatever it states.
ENDLESS = {"lower": -math.inf, "upper": math.inf}

#: Closures by the type of the joint.
CLOSURES = {
    "fixed": "fixed", "revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic",
    "ball": "spherical", "universal": "universal",
}  # fmt: skip

#: Largest distance at which an axis still passes through an origin, and largest part of a unit axis that is
#: rounding, relative to the coordinates: poses are products of a few matrices.
POSE_ROUNDING = 16 * np.finfo(float).eps


def read_sdf(root: Node, package_dirs: Sequence[str | os.PathLike[str]] = ()) -> RobotFile:
    """Read the root element of an SDF file.

    Args:
        root: Root element `<sdf>`.
        package_dirs: Folders, beside the robot's own, from which files may be included.

    Raises:
        ModelError: The file has several robots or none, an element is invalid, or it states something that
            hybridyn does not have.
    """
    library = Library(root, package_dirs)
    models = Models(library)
    robot = RobotFile(models.robot.name, root.file, format="SDF")
    robot.gravity = _gravity(models.world)
    joints = read_joints(models, robot.file, library.notes)
    robot.links += [read_link(item, robot.file, library.notes) for item in models.every("link")]
    _Builder(robot, models).build(joints, library.notes)
    _read_plugins(robot, models)
    robot.notes += noted(library.notes)
    return robot


def _read_plugins(robot: RobotFile, models: Models) -> None:
    """Add the welds of DetachableJoints, which hold two links as the poses place them.

    Raises:
        ModelError: Another plugin joins links of the robot.
    """
    stated = [
        (item, plugin)
        for item in models.every("model")
        for node in dict.fromkeys((item.node, item.model))
        for plugin in node.children("plugin")
    ]
    links = {item.name for item in models.every("link")}
    taken = {closure.name for closure in robot.closures}
    for item, plugin in (*stated, *((None, plugin) for plugin in models.world.children("plugin"))):
        ends = weld_of(plugin, item.name) if item is not None else None
        if ends is None:
            refuse_holding(plugin, links, 'write <joint type="fixed"> or the joint that it stands for')
            continue
        held = [models.link(item, end.content(), end) for end in ends]
        first, second = (models.robot if one is None else one for one in held)
        if None in held or first is second:
            raise plugin.error("welds no two links of the robot; remove it, or write a fixed joint")
        name = unique(f"weld_{first.full_name}_{second.full_name}", taken)
        at = inverse(models.pose(first)) @ models.pose(second)
        sides = (first.full_name, at), (second.full_name, np.eye(4))
        robot.closures.append(closure_of(name, "fixed", sides, line=_line(plugin, robot.file)))


def _gravity(world: Node) -> tuple[float, float, float] | None:
    """Return the acceleration of gravity of a world [m/s^2], None without a world."""
    if world.tag != "world":
        return None
    holders = world, *world.children("physics")  # <physics> in SDFormat 1.4
    node = next((node for holder in holders if (node := holder.child("gravity")) is not None), None)
    if node is None or not node.content():
        return GRAVITY
    x, y, z = (float(number) for number in node.numbers("", 3))
    return x, y, z


class _Builder:
    """Makes the record of a robot of its links and joints."""

    def __init__(self, robot: RobotFile, models: Models) -> None:
        self.robot, self.models = robot, models
        self.steps: dict[Item, list[str]] = {}

    def build(self, joints: list[Stated], notes: Notes) -> None:
        """Add joints, closures, couplings and springs to the robot; `notes` takes what is noted."""
        poses = {link.full_name: self.models.pose(link) for link in self.models.every("link")}
        self.graph = JointGraph(
            self.robot, {name: name for name in poses}, {joint.name for joint in joints}, "{child}_fixed"
        )
        tree = span(starts(poses, joints, ()), joints)
        welds = [
            joint for joint in joints if joint.kind == "fixed" and WORLD in joint.ends
            and np.array_equal(self.models.pose(joint.links[joint.ends[0] == WORLD]), np.eye(4))
        ]  # fmt: skip
        self.graph.fill(tree, poses, welds, self._chain, self._closing)
        if self.robot.base == "floating":
            notes[FLOATS] = [self.robot.name]
        whole = [joint for joint in tree.cut if not joint.needed]
        notes[CLOSED] = [joint.name for joint in whole if any(axis.limited for axis in joint.axes)]
        springs: list[StatedSpring] = []
        for joint in joints:
            for name, axis in zip(self.steps.get(joint.item, ()), joint.axes, strict=False):
                if axis.mimic is not None:
                    self.robot.couplings.append(self._coupling(name, *axis.mimic, joint.line))
                if axis.spring[0]:
                    springs.append(StatedSpring(name, *axis.spring))
        if springs:
            self.robot.effects += (spring_effect(springs),)

    def _chain(self, joint: Stated, forward: bool) -> Chain:
        """Return a joint as a chain from the link above to that below, and its frame in both.

        The frame has the axes of the link below.
        """
        above, below = joint.links if forward else joint.links[::-1]
        start, end = self.models.pose(above), self.models.pose(below)
        origin = placement_from(np.eye(3), _origin(joint, start, end))
        names = [joint.name]
        if AXES[joint.kind] == 2:
            names = [self.graph.joint_name(f"{joint.name}_{number}") for number in (1, 2)]
        steps: list[Joint] = []
        for name, axis in zip(names, joint.axes, strict=bool(joint.axes)):
            along = tidy(end[:3, :3].T @ axis.direction)
            stated = axis.numbers | joint.rotor | (ENDLESS if joint.kind == "continuous" else {})
            steps.append(step(name, KINDS[joint.kind], along, **stated))
            if axis.initial and not math.isnan(axis.initial):
                self.robot.home[name] = (axis.initial,)
        if joint.kind == "ball":
            steps.append(step(joint.name, "spherical"))
        self.steps[joint.item] = names
        return steps if forward else steps[::-1], (inverse(start) @ end @ origin, origin)

    def _closing(self, joint: Stated, links: tuple[str, str]) -> Closure:
        """Return a joint as a closure between two links."""
        kind = CLOSURES[joint.kind]
        along = [tidy(joint.at[:3, :3].T @ axis.direction) for axis in joint.axes]
        turns = [rotation_to_axis(axis) for axis in along if FORMS[kind].has_axis] or [np.eye(3)]
        frames = [inverse(self.models.pose(link)) @ joint.at for link in joint.links]
        sides = zip(links, frames, strict=True)
        return closure_of(joint.name, kind, sides, (turns[0], turns[-1]), line=joint.line)

    def _coupling(self, follower: str, mimic: Node, leader: Item, line: int | None) -> Coupling:
        """Return the coupling: position = multiplier (position of the leader - reference) + offset."""
        which = str(mimic.xml.get("axis", "")).strip() or "axis"
        if which not in ("axis", "axis2"):
            raise mimic.error(f"axis '{which}' instead of 'axis' or 'axis2'")
        number = ("axis", "axis2").index(which)
        if number >= AXES[leader.node.text("type")]:
            word = "second axis" if number else "axis"
            raise mimic.error(f"joint '{leader.full_name}' has no {word} that could lead")
        name = self.steps[leader][number]
        if name == follower:
            raise mimic.error("a joint cannot follow itself")
        ratio, offset, reference = numbers(mimic, "mimic").values()
        return Coupling(follower, ((follower, 1.0), (name, -ratio)), offset - ratio * reference, line)


def tidy(axis: Array) -> Array:
    """Return a unit vector without parts that are rounding, shape (3,).

    Args:
        axis: A vector of length 1 within rounding.
    """
    kept = np.where(np.abs(axis) <= POSE_ROUNDING, 0.0, axis)
    return np.sign(kept) if np.count_nonzero(kept) == 1 else kept / np.linalg.norm(kept)


def _origin(joint: Stated, start: Array, end: Array) -> Array:
    """Return the joint's place in the frame of the link below, shape (3,); zeros where none matters."""
    if joint.kind in ("fixed", "prismatic"):
        return np.zeros(3)
    places = (start[:3, 3], end[:3, 3], joint.at[:3, 3])
    size = max(float(np.abs(place).max()) for place in places)
    origin: Array = end[:3, :3].T @ (joint.at[:3, 3] - end[:3, 3])
    across = origin
    if joint.kind in ("revolute", "continuous"):
        axis = end[:3, :3].T @ joint.axes[0].direction
        across = origin - axis * (axis @ origin)
    return np.zeros(3) if np.abs(across).max() <= POSE_ROUNDING * size else origin
