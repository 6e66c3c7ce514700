"""Read a USD file: OpenUSD composes it in a process of its own, and its prims become records.

What hybridyn does not have is an error that names the prim. What does not change the motion is left out, with
a remark where other engines might use it.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ...errors import ModelError
from ..closure_forms import ROWS, form_of_rows
from ..joint_graph import Chain, Closing, JointGraph, Step, Tree, span
from ..names import listed
from ..records import JointKind
from ..robot_file import RobotFile
from .bodies import Bodies
from .couplings import coupled, couplings
from .driving import Motors, actuated, is_driven, numbers_of, numbers_of_ball
from .homes import add_home
from .joints import AXES, UsdJoint, direction, read_joints, roots_of
from .masses import links_of
from .naming import names_of
from .opening import open_usd
from .scenes import gravity_of
from .screening import screen


def read_usd(file: str, package_dirs: Sequence[str | os.PathLike[str]] = ()) -> RobotFile:
    """Read a USD file.

    Args:
        package_dirs: Folders, beside the robot's own, in which layers may be.

    Raises:
        ModelError: usd-core is not installed, OpenUSD refuses the file, or it states something that hybridyn
            does not have.
    """
    stage = open_usd(file, package_dirs)
    name = Path(stage.file).name.partition(".")[0] or "robot"
    robot = RobotFile(name if stage.default is None else stage.default.name, file, format="USD")
    screen(stage, robot.notes)
    bodies = Bodies(stage)
    if not bodies.moving:
        raise ModelError("no prim has PhysicsRigidBodyAPI; a robot has at least one body", file=file)
    _Builder(robot, bodies).build()
    robot.gravity = gravity_of(stage)
    _add_notes(robot, bodies)
    return robot


class _Builder:
    """Makes the record of a robot of its bodies and joints.

    Attributes:
        actuated: Paths of the joints on which actuators act.
        names: Names of the joints of each axis by path; "ball" has three freedoms.
        made: The joints that have a position, each with whether its second body is the child.
    """

    def __init__(self, robot: RobotFile, bodies: Bodies) -> None:
        self.robot, self.bodies, self.stage = robot, bodies, bodies.stage
        self.actuated = actuated(self.stage)
        driven = {prim.path for prim in self.stage.prims.values() if is_driven(prim)}
        self.bound = driven | self.actuated | coupled(self.stage)
        self.joints = read_joints(bodies, self.bound, robot.notes)
        links = names_of(bodies.moving.values(), set())
        self.graph = JointGraph(robot, links, {joint.name for joint in self.joints}, "{joint}_fixed")
        self.motors = Motors()
        self.names: dict[str, dict[str, str]] = {}
        self.made: list[tuple[UsdJoint, bool]] = []

    def build(self) -> None:
        """Add links, joints, closures, couplings, motors and home to the robot."""
        robot, bodies = self.robot, self.bodies
        tree = span(roots_of(bodies, self.joints), self.joints)
        self._note(tree)
        poses = {path: bodies.pose(prim).frame for path, prim in bodies.moving.items()}
        welds = [
            joint for joint in self.joints
            if not joint.free and all(np.array_equal(frame, np.eye(4)) for frame in joint.frames)
        ]  # fmt: skip
        robot.links += links_of(bodies, self.graph.links)
        self.graph.fill(tree, poses, welds, self._chain, _closing)
        robot.couplings += couplings(
            self.stage, {joint.prim.path: joint for joint in self.joints}, self.names, robot.notes
        )
        self.motors.state(robot)
        add_home(robot, bodies, self.made, self.names)

    def _chain(self, joint: UsdJoint, forward: bool) -> Chain:
        """Return a joint as a chain from its parent to its child; add its motors."""
        chain, prim, steps = joint.chain(), joint.prim, []
        names = self.names[prim.path] = {}
        for axis in chain:
            name = joint.name if len(chain) == 1 else self.graph.joint_name(f"{joint.name}_{axis}")
            names[axis] = name
            if axis == "ball":
                steps.append(Step(name, "spherical", numbers=numbers_of_ball(prim)))
                self.motors.add(prim, "", name, prim.path in self.actuated)
                continue
            instance, angular = joint.instance(axis), axis.startswith("rot")
            kind: JointKind = "revolute" if angular else "prismatic"
            lower, upper = joint.limits[axis]
            numbers = {"lower": lower, "upper": upper} | numbers_of(prim, instance, angular)
            steps.append(Step(name, kind, direction(axis), numbers))
            self.motors.add(prim, instance, name, prim.path in self.actuated and len(chain) == 1)
        self.made.append((joint, forward))
        return (steps, joint.frames) if forward else (steps[::-1], joint.frames[::-1])

    def _note(self, tree: Tree[UsdJoint]) -> None:
        """Add remarks where the cuts are not those of the file."""
        own = [joint.prim.path for joint in tree.cut if not joint.closes]
        if own:
            self.robot.notes.append(
                f"joints {listed(own)} close loops and are cut there; to cut other joints, set "
                "physics:excludeFromArticulation = true on those"
            )
        kept = [joint.prim.path for joint, _ in tree.branches if joint.closes]
        if kept:
            self.robot.notes.append(
                f"joints {listed(kept)} are excluded from the articulation, but are driven or coupled, or "
                "are the only joint of a body: they are joints of the tree"
            )
        limited = [
            joint.prim.path
            for joint in tree.cut
            if np.isfinite([*joint.limits.values()]).any() and not joint.needed
        ]
        if limited:
            self.robot.notes.append(f"limits of joints that close loops are not read: {listed(limited)}")


def _closing(joint: UsdJoint) -> Closing:
    """Return a joint as a closure."""
    rows = [row for row, axis in zip(ROWS, AXES, strict=True) if axis not in joint.free]
    form = form_of_rows(" ".join(rows))
    kind = joint.prim.kind.removeprefix("Physics").removesuffix("Joint").lower() or "rows"
    turn = form.rotation_of_frames
    return Closing(kind, joint.frames, form.translations, form.rotation, (turn, turn))


def _add_notes(robot: RobotFile, bodies: Bodies) -> None:
    """Add remarks on what is taken by default or left out."""
    stage = bodies.stage
    if "metersPerUnit" not in stage.authored:
        robot.notes.append("the file states no metersPerUnit: lengths are in centimetres, the default of USD")
    if bodies.still:
        robot.notes.append(
            f"bodies {listed(bodies.still)} are kinematic or disabled: they are read as parts of the world"
        )
    massless = [
        link.name
        for link in robot.links
        if not link.mass and not link.between_joints and link.name != "world"
    ]
    if massless:
        robot.notes.append(
            f"bodies {listed(massless)} state no mass and have none here (PhysX would take 1 kg)"
        )
    prims = stage.prims.values()
    if sum(prim.has("PhysicsCollisionAPI") for prim in prims) > 1:
        robot.notes.append(
            "contacts between colliders are not read: the robot touches nothing (the effect ground_contact "
            "has points on compliant ground)"
        )
    moving = [prim.path for prim in prims if any(_moves(prim.values.get(n)) for n in VELOCITIES)]
    if moving:
        robot.notes.append(f"velocities at the start are not read: {listed(moving)}")
    cones = [prim.path for prim in prims if any(_is_cone(prim.values.get(n)) for n in CONES)]
    if cones:
        robot.notes.append(f"limits of spherical joints are not read: {listed(cones)}")


#: Attributes of velocities, and of the limits of spherical joints.
VELOCITIES = ("physics:velocity", "physics:angularVelocity")
CONES = ("physics:coneAngle0Limit", "physics:coneAngle1Limit")


def _moves(value: object) -> bool:
    return isinstance(value, list) and any(value)


def _is_cone(value: object) -> bool:
    return isinstance(value, int | float) and value >= 0 and value != float("inf")
