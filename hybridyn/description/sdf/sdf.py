"""Read an SDF file: one model, with the files that it includes, becomes records.

Forces and joints that hybridyn does not have are errors. Plugins, sensors and shapes are not read.
"""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...joints.kinds import JointKind
from ..closure_forms import FORMS, closure_of
from ..gearboxes import Gearbox, coupling_of
from ..joint_chains import step
from ..joint_graph import WORLD, Chain, JointGraph, span, starts
from ..names import noted, unique
from ..placement import inverse, placement_from, rotation_to_axis
from ..plugins import refuse_holding, weld_of
from ..records import Array, Closure, Coupling, RobotFile, StatedSpring, spring_effect
from ..urdf.drake import BALL, read_ball_constraint
from ..urdf.drake_forces import BUSHING, SPRING, read_bushings, spring_effects
from ..urdf.xml_node import XmlNode
from .elements import Notes, flag, numbers
from .models import Item, SdfFiles, SdfModels
from .stated import AXES, ENDLESS, SDF, WEIGHTLESS, Stated, line_of, read_joints, read_link

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

#: Largest distance at which an axis still passes through an origin, and largest part of a unit axis that is
#: rounding, relative to the coordinates: poses are products of a few matrices.
POSE_ROUNDING = 16 * np.finfo(float).eps


def read_sdf(
    root: XmlNode, package_dirs: Sequence[str | os.PathLike[str]] = (), chosen: str = ""
) -> RobotFile:
    """Read the root element of an SDF file.

    Args:
        root: Root element `<sdf>`.
        package_dirs: Folders, beside the robot's own, from which files may be included.
        chosen: Name of the model that is read, "" for the only one.

    Raises:
        ModelError: The file has several robots or none, an element is invalid, or it states something that
            hybridyn does not have.
    """
    library = SdfFiles(root, package_dirs, chosen)
    models = SdfModels(library)
    robot = RobotFile(models.name, root.file, format="SDF")
    robot.gravity = _gravity(models.world)
    joints, gearboxes = read_joints(models, robot.file, library.notes)
    robot.links += [read_link(item, models, robot.file, library.notes) for item in models.every("link")]
    _SdfBuilder(robot, models).build(joints, gearboxes, library.notes)
    light = [item.full_name for item in models.every("link") if not flag(item.node, "gravity", True)]
    if light:
        library.notes[WEIGHTLESS] = light
        robot.effects += (("gravity_compensation", {"fraction": dict.fromkeys(light, 1.0)}),)
    _read_plugins(robot, models)
    _read_drake(robot, models)
    robot.notes += noted(library.notes)
    return robot


def _read_drake(robot: RobotFile, models: SdfModels) -> None:
    """Add the ball constraints, the springs between points and the bushings that Drake has in models."""
    taken = {closure.name for closure in robot.closures}
    for item in models.every("model"):

        def link_of(node: XmlNode, name: str, scope: Item = item) -> str:
            """Return the link of a name in the model.

            Raises:
                ModelError: It is the world, or no link.
            """
            link = models.link(scope, name, node)
            if link is None:
                raise node.error("joins no two links of the robot")
            return link.full_name

        def frame_of(node: XmlNode, name: str, scope: Item = item) -> tuple[str, Array]:
            """Return the link that carries a frame of the model, and the frame in it; see `link_of`."""
            at = models.pose(models.resolve(scope, name, node))
            link = models.link(scope, name, node)
            if link is None:
                raise node.error("joins no two links of the robot")
            return link.full_name, inverse(models.pose(link)) @ at

        for node in item.model.children(BALL):
            closure = read_ball_constraint(node, link_of)
            line = line_of(node, robot.file)
            robot.closures.append(replace(closure, name=unique(closure.name, taken), line=line))
        robot.effects += spring_effects(item.model.children(SPRING), link_of)
        read_bushings(item.model.children(BUSHING), frame_of, robot)


def _read_plugins(robot: RobotFile, models: SdfModels) -> None:
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
        robot.closures.append(closure_of(name, "fixed", sides, line=line_of(plugin, robot.file)))


def _gravity(world: XmlNode) -> tuple[float, float, float] | None:
    """Return the acceleration of gravity of a world [m/s^2], None without a world."""
    if world.tag != "world":
        return None
    holders = world, *world.children("physics")  # <physics> in SDFormat 1.4
    node = next((node for holder in holders if (node := holder.child("gravity")) is not None), None)
    if node is None or not node.content():
        return GRAVITY
    x, y, z = (float(number) for number in node.numbers("", 3))
    return x, y, z


class _SdfBuilder:
    """Makes the record of a robot of its links and joints."""

    def __init__(self, robot: RobotFile, models: SdfModels) -> None:
        self.robot, self.models = robot, models
        self.steps: dict[Item, list[str]] = {}

    def build(self, joints: list[Stated], gearboxes: list[Stated], notes: Notes) -> None:
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
        self.robot.couplings += [self._gearbox(box) for box in gearboxes]
        if springs:
            self.robot.effects += (spring_effect(springs),)

    def _gearbox(self, box: Stated) -> Coupling:
        """Return the coupling of a gearbox.

        Raises:
            ModelError: It ties no joints of the tree, or names a world in which nothing holds the robot.
        """
        node = box.item.node
        body = node.required_child("gearbox_reference_body")
        base = self.models.link(box.item.scope, body.content(), body)
        names = [
            self.graph.links.get(end, "") for end in (*box.ends, WORLD if base is None else base.full_name)
        ]
        if "" in names:
            raise node.error("names the world, in which nothing holds the robot")
        one, other = (
            self.models.pose(link)[:3, :3].T @ axis.direction
            for link, axis in zip(box.links, box.axes, strict=True)
        )
        ratio = numbers(node, "joint")["gearbox_ratio"]
        try:
            return coupling_of(
                Gearbox(box.name, (names[0], names[1]), (one, other), names[2], ratio, box.line), self.robot
            )
        except ValueError as error:
            raise node.error(str(error)) from None

    def _chain(self, joint: Stated, forward: bool) -> Chain:
        """Return a joint as a chain from the link above to that below, and its frame in both.

        The frame has the axes of the link below.
        """
        above, below = joint.links if forward else joint.links[::-1]
        start, end = self.models.pose(above), self.models.pose(below)
        origin = placement_from(np.eye(3), _origin(joint, start, end))
        names = [joint.name]
        if len(joint.chain) == 2:
            names = [self.graph.joint_name(f"{joint.name}_{number}") for number in (1, 2)]
        steps = [step(joint.name, kind) for kind in joint.chain if not kind.single]
        for name, kind, axis in zip(names, joint.chain, joint.axes, strict=bool(joint.axes)):
            along = tidy(end[:3, :3].T @ axis.direction)
            stated = joint.rotor | axis.numbers | (ENDLESS if kind.endless else {})
            flat = kind is JointKind.SCREW and not joint.pitch
            steps.append(step(name, JointKind.REVOLUTE if flat else kind, along, pitch=joint.pitch, **stated))
            if axis.initial and not math.isnan(axis.initial):
                self.robot.home[name] = (axis.initial,)
        self.steps[joint.item] = names
        return steps if forward else steps[::-1], (inverse(start) @ end @ origin, origin)

    def _closing(self, joint: Stated, links: tuple[str, str]) -> Closure:
        """Return a joint as a closure between two links."""
        kind = SDF[joint.kind].closure
        along = [tidy(joint.at[:3, :3].T @ axis.direction) for axis in joint.axes]
        turns = [rotation_to_axis(axis) for axis in along if FORMS[kind].has_axis] or [np.eye(3)]
        frames = [inverse(self.models.pose(link)) @ joint.at for link in joint.links]
        sides = zip(links, frames, strict=True)
        return closure_of(joint.name, kind, sides, (turns[0], turns[-1]), line=joint.line)

    def _coupling(self, follower: str, mimic: XmlNode, leader: Item, line: int | None) -> Coupling:
        """Return the coupling: position = multiplier (position of the leader - reference) + offset."""
        which = mimic.attrib.get("axis", "").strip() or "axis"
        if which not in ("axis", "axis2"):
            raise mimic.error(f"axis '{which}' instead of 'axis' or 'axis2'")
        number = ("axis", "axis2").index(which)
        if number >= AXES[leader.node.text("type")] or leader not in self.steps:
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
    if all(kind.slides for kind in joint.chain):
        return np.zeros(3)
    places = (start[:3, 3], end[:3, 3], joint.at[:3, 3])
    size = max(float(np.abs(place).max()) for place in places)
    origin: Array = end[:3, :3].T @ (joint.at[:3, 3] - end[:3, 3])
    across = origin
    if len(joint.axes) == 1:
        axis = end[:3, :3].T @ joint.axes[0].direction
        across = origin - axis * (axis @ origin)
    return np.zeros(3) if np.abs(across).max() <= POSE_ROUNDING * size else origin
