"""Read an SDF file: one model, with the files that it includes, becomes records.

Forces and joints that hybridyn does not have are errors. Plugins, sensors and shapes are not read.
"""

from __future__ import annotations

import os
from collections.abc import Sequence

import numpy as np

from ..closure_forms import FORMS
from ..joint_graph import WORLD, Chain, Closing, JointGraph, Step, span, starts
from ..names import listed
from ..placement import inverse, placement_from, rotation_to_axis
from ..records import Array, Coupling, JointKind
from ..robot_file import RobotFile
from ..urdf.xml_node import Node
from .joints import AXES, Axis, Mimic, Remarks, Stated, read_joints
from .library import Library
from .links import add_links
from .models import MODEL, Item, Models
from .world import choose_model, gravity_of

#: Kinds of joints by type; those of several axes are chains.
KINDS: dict[str, JointKind] = {
    "revolute": "revolute", "continuous": "continuous", "prismatic": "prismatic", "ball": "spherical",
    "universal": "revolute", "revolute2": "revolute",
}  # fmt: skip

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
    library = Library(root, [os.fspath(folder) for folder in package_dirs])
    robot = RobotFile("robot", root.file, format="SDF")
    chosen = choose_model(root, library, robot)
    models = Models(chosen.world or root, chosen.model, chosen.source, chosen.own, library)
    links = list(models.every("link"))
    if not links:
        raise chosen.model.error("the model has no <link>; a robot has at least one")
    robot.name = models.robot.name
    robot.gravity = gravity_of(chosen.world)
    remarks = Remarks()
    joints = read_joints(models, robot.file, remarks)
    add_links(robot, links)
    _Builder(robot, models, links, joints).build(joints)
    robot.notes += [*remarks.notes(), *library.unread.notes()]
    return robot


class _Builder:
    """Makes the record of a robot of its links and joints."""

    def __init__(self, robot: RobotFile, models: Models, links: list[Item], joints: list[Stated]) -> None:
        self.robot, self.models, self.links = robot, models, links
        names = {link.full_name: link.full_name for link in links}
        self.graph = JointGraph(robot, names, {joint.name for joint in joints}, "{child}_fixed")
        self.steps: dict[Item, list[str]] = {}

    def build(self, joints: list[Stated]) -> None:
        """Add joints, closures, couplings and springs to the robot."""
        model = self.models.robot
        named = bool(model.model.xml.get("canonical_link"))
        first = self.models.link(model, MODEL, model.model) if named else None
        poses = {link.full_name: self.models.pose(link) for link in self.links}
        tree = span(starts(poses, joints, [] if first is None else [first.full_name]), joints)
        welds = [
            joint for joint in joints if joint.kind == "fixed" and WORLD in joint.ends
            and np.array_equal(self.models.pose(joint.links[joint.ends[0] == WORLD]), np.eye(4))
        ]  # fmt: skip
        self.graph.fill(tree, poses, welds, self._chain, self._closing)
        if self.robot.base == "floating":
            self.robot.notes.append(
                "nothing joins the model to the world, so its base floats; to hold it, load it with "
                "base='fixed', or write a fixed joint with <parent>world</parent>"
            )
        whole = [joint for joint in tree.cut if not joint.needed]
        if limited := [joint.name for joint in whole if any(axis.limited for axis in joint.axes)]:
            self.robot.notes.append(
                f"limits of closures are not read: {listed(limited)}; to keep them, cut another joint of the "
                "loop (<physics><simbody><must_be_loop_joint>true)"
            )
        for joint in joints:
            for number, axis in enumerate(joint.axes):
                if axis.mimic is not None:
                    name = self.steps[joint.item][number]
                    self.robot.couplings.append(self._coupling(name, axis.mimic, joint.line))
        self._add_springs(joints)

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
        kind = KINDS.get(joint.kind)
        steps: list[Step] = []
        for name, axis in zip(names, joint.axes, strict=bool(joint.axes)):
            along = tidy(end[:3, :3].T @ axis.direction)
            steps.append(Step(name, KINDS[joint.kind], along, _numbers(joint, axis)))
            if axis.initial:
                self.robot.home[name] = (axis.initial,)
        if kind == "spherical":
            steps.append(Step(joint.name, kind))
        self.steps[joint.item] = names
        return steps if forward else steps[::-1], (inverse(start) @ end @ origin, origin)

    def _closing(self, joint: Stated) -> Closing:
        """Return a joint as a closure."""
        kind = CLOSURES[joint.kind]
        form, turns = FORMS[kind], [np.eye(3)] * 2
        if form.has_axis:
            along = [tidy(joint.at[:3, :3].T @ axis.direction) for axis in joint.axes]
            turns = [rotation_to_axis(along[0]), rotation_to_axis(along[-1])]
        frames = [inverse(self.models.pose(link)) @ joint.at for link in joint.links]
        return Closing(kind, frames, form.translations, form.rotation, turns)

    def _coupling(self, follower: str, mimic: Mimic, line: int | None) -> Coupling:
        kind = mimic.joint.node.text("type")
        if mimic.number >= AXES[kind]:
            which = "second axis" if mimic.number else "axis"
            raise mimic.node.error(f"joint '{mimic.joint.full_name}' has no {which} that could lead")
        leader = self.steps[mimic.joint][mimic.number]
        if leader == follower:
            raise mimic.node.error("a joint cannot follow itself")
        return Coupling(follower, ((follower, 1.0), (leader, -mimic.multiplier)), mimic.offset, line)

    def _add_springs(self, joints: list[Stated]) -> None:
        """Add the springs of joints as an effect."""
        springs = {
            name: axis
            for joint in joints if joint.item in self.steps
            for name, axis in zip(self.steps[joint.item], joint.axes, strict=False) if axis.stiffness
        }  # fmt: skip
        if springs:
            stiffness = {name: axis.stiffness for name, axis in springs.items()}
            rest = {name: axis.rest for name, axis in springs.items()}
            self.robot.effects += (("spring", {"stiffness": stiffness, "rest": rest}),)


def tidy(axis: Array) -> Array:
    """Return a unit vector without parts that are rounding, shape (3,).

    Args:
        axis: A vector of length 1 within rounding.
    """
    kept = np.where(np.abs(axis) <= POSE_ROUNDING, 0.0, axis)
    return np.sign(kept) if np.count_nonzero(kept) == 1 else kept / np.linalg.norm(kept)


def _numbers(joint: Stated, axis: Axis) -> dict[str, float]:
    endless = {"lower": -np.inf, "upper": np.inf} if joint.kind == "continuous" else {}
    return axis.numbers | joint.rotor | endless


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
