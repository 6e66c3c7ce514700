"""Read a USD file: OpenUSD composes it in a child process, and its prims become records.

What hybridyn does not have is an error that names the prim. What does not change the motion is left out, with
a remark where other engines might use it.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ...errors import ModelError
from ..names import listed
from ..records import Joint, Link
from ..robot_file import RobotFile
from .bodies import Bodies
from .driving import Driving, add_motors, is_driven
from .graph import WORLD, Tree, grow
from .homes import add_home, pose_coordinates
from .joints import UsdJoint, read_joints
from .masses import masses
from .mimics import bound_joints, couplings
from .naming import NAME, names_of
from .opening import open_usd
from .rods import Rod, add_rod, read_rods
from .scenes import gravity_of
from .screening import screen
from .stage import Stage
from .trees import add_joint, closure_of

#: Name of the link of the world.
ROOT = "world"


def read_usd(file: str, package_dirs: Sequence[str | os.PathLike[str]] = ()) -> RobotFile:
    """Read a USD file.

    Args:
        package_dirs: Folders, beside the robot's own, in which layers may be.

    Raises:
        ModelError: usd-core is not installed, OpenUSD refuses the file, or it states something that hybridyn
            does not have.
    """
    stage = open_usd(file, package_dirs)
    robot = RobotFile(_name(stage), file, format="USD")
    screen(stage, robot.notes)
    bodies = Bodies(stage)
    if not bodies.moving:
        raise ModelError("no prim has PhysicsRigidBodyAPI; a robot has at least one body", file=file)
    joints, rods = read_joints(bodies, robot.notes), read_rods(bodies, robot.notes)
    bound = bound_joints(stage) | {joint.prim.path for joint in joints if is_driven(joint)}
    tree = grow(bodies.moving.values(), joints, bound, robot.notes)
    _build(robot, bodies, joints, rods, tree)
    robot.gravity = gravity_of(stage)
    _add_notes(robot, bodies)
    return robot


def _name(stage: Stage) -> str:
    """Return the name of the robot: that of the default prim, else of the file."""
    default = stage.default
    if default is None:
        return Path(stage.file).name.partition(".")[0] or "robot"
    return default.word(NAME, default.name)


def _build(robot: RobotFile, bodies: Bodies, joints: list[UsdJoint], rods: list[Rod], tree: Tree) -> None:
    """Add links, joints, closures, couplings, motors and home to the robot."""
    stage = bodies.stage
    base = _base(bodies, tree, rods)
    links = names_of(bodies.moving.values(), {ROOT} if base is None else set())
    if base is None:
        links[WORLD] = ROOT
        robot.links.append(Link(ROOT, 0.0, np.zeros(3), np.zeros((3, 3))))
    elif base in tree.roots:
        robot.base = "floating"
        robot.base_home = pose_coordinates(bodies.pose(bodies.moving[base]).frame)
    else:
        links[WORLD] = links[base]
    own_names = names_of([*(joint.prim for joint in joints), *(rod.prim for rod in rods)], set())
    taken = {*links.values()}, {*own_names.values()}
    for path, mass in masses(bodies).items():
        between = bodies.moving[path].flag("hybridyn:betweenJoints", False)
        robot.links.append(Link(links[path], mass.mass, mass.com, mass.inertia, None, between))
    driving = Driving()
    names: dict[str, dict[str, str]] = {}
    kept = [
        (joint, forward) for joint, forward in tree.joints if base is None or {*joint.ends} != {WORLD, base}
    ]
    for joint, forward in kept:
        ends = links[joint.ends[0]], links[joint.ends[1]]
        name = own_names[joint.prim.path]
        names[joint.prim.path] = add_joint(robot, joint, forward, name, ends, driving, taken)
    if base is None:
        _float(robot, bodies, tree.roots, links, taken[1])
    for joint in tree.closures:
        ends = links[joint.ends[0]], links[joint.ends[1]]
        robot.closures.append(closure_of(joint, own_names[joint.prim.path], ends))
    for rod in rods:
        ends = links[rod.ends[0]], links[rod.ends[1]]
        add_rod(robot, bodies, rod, own_names[rod.prim.path], ends, taken)
    limited = [joint.prim.path for joint in tree.closures if np.isfinite([*joint.limits.values()]).any()]
    if limited:
        robot.notes.append(f"limits of joints that close loops are not read: {listed(limited)}")
    by_path = {joint.prim.path: joint for joint in joints}
    robot.couplings += couplings(stage, by_path, names, robot.notes)
    add_motors(robot, driving)
    add_home(robot, bodies, kept, names)


def _base(bodies: Bodies, tree: Tree, rods: list[Rod]) -> str | None:
    """Return the path of the body that is the root of the robot, or None if the world is.

    A body is the root if it floats and everything else hangs on it, or if a fixed joint holds it at the
    origin of the world and nothing else touches the world.
    """
    if any(WORLD in rod.ends for rod in rods):
        return None
    if len(tree.roots) == 1 and len(bodies.moving) == 1 + sum(bool(up) for up in tree.parents.values()):
        return tree.roots[0]
    held = [joint for joint, _ in tree.joints if WORLD in joint.ends]
    if tree.roots or len(held) != 1 or any(WORLD in joint.ends for joint in tree.closures):
        return None
    (joint,) = held
    exact = all(np.array_equal(frame, np.eye(4)) for frame in joint.frames)
    if joint.free or not exact:
        return None
    first, second = joint.ends
    return first or second


def _float(
    robot: RobotFile, bodies: Bodies, roots: list[str], links: dict[str, str], taken: set[str]
) -> None:
    """Let bodies that no joint ties to the world float in it, by joints of their own."""
    for path in roots:
        name = f"{links[path]}_free"
        while name in taken:
            name += "_"
        taken.add(name)
        robot.joints.append(Joint(name, "floating", ROOT, links[path], np.eye(4), np.array([1.0, 0.0, 0.0])))
        robot.home[name] = pose_coordinates(bodies.pose(bodies.moving[path]).frame)


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
        link.name for link in robot.links if not link.mass and not link.between_joints and link.name != ROOT
    ]
    if massless:
        robot.notes.append(
            f"bodies {listed(massless)} state no mass and have none here (PhysX would take 1 kg)"
        )
    if stage.edited:
        robot.notes.append(
            f"{listed(stage.edited)} were edited since hybridyn wrote them: their copies in hybridyn:exact "
            "are not taken"
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
