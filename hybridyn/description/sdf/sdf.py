"""Read an SDF file: one model, with the files that it includes, becomes records.

Forces and joints that hybridyn does not have are errors. Plugins, sensors and shapes are not read.
"""

from __future__ import annotations

import os
from collections.abc import Sequence

import numpy as np

from ..mjcf.naming import unique
from ..records import Joint, Link
from ..robot_file import RobotFile
from ..urdf.xml_node import Node
from .axes import Remarks
from .chains import Names, add_branch, home_pose
from .couplings import add_couplings, reference_body
from .graph import Branch, Tree, importance, span
from .joints import Stated, read_joint
from .library import Library
from .links import add_links
from .loops import add_loops
from .poses import Poses
from .scopes import MODEL, Item, Scope, add_model
from .world import choose_model, gravity_of


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
    world = Scope(chosen.world or root, library.source)
    for node in world.node.children("joint", "frame"):
        world.add_node(node)
    add_model(world, chosen.model, chosen.source, chosen.own, library)
    (model,) = world.items["model"].values()
    if next(world.everything("link"), None) is None:
        raise chosen.model.error("the model has no <link>; a robot has at least one")
    robot.name = model.name
    robot.gravity = gravity_of(chosen.world)
    poses = Poses(world)
    remarks = Remarks()
    joints = [read_joint(item, poses, remarks) for item in world.everything("joint")]
    add_links(robot, world)
    _add_joints(robot, world, joints, poses)
    robot.notes += [*remarks.notes(), *library.unread.notes()]
    return robot


def _add_joints(robot: RobotFile, world: Scope, joints: list[Stated], poses: Poses) -> None:
    named = {axis.mimic.joint for joint in joints for axis in joint.axes if axis.mimic is not None}
    named |= _geared(joints, poses)
    connecting = [joint for joint in joints if joint.kind != "gearbox"]
    tree = span(world.everything("link"), connecting, named, _canonical(world, poses))
    names = Names({link.name for link in robot.links}, {joint.name for joint in joints})
    branches = _root(robot, tree, poses, names)
    for branch in branches:
        add_branch(robot, branch, poses, names)
    add_loops(robot, [(joint, importance(joint, named)) for joint in tree.cut], poses, names)
    add_couplings(robot, joints, branches, poses, names)
    _add_springs(robot, names)


def _add_springs(robot: RobotFile, names: Names) -> None:
    """Add the springs of joints as an effect."""
    stiffness: dict[str, float] = {}
    rest: dict[str, float] = {}
    for part in (part for parts in names.parts.values() for part in parts):
        if part.axis is not None and part.axis.stiffness:
            stiffness[part.name] = part.axis.stiffness
            rest[part.name] = part.axis.rest + part.position
    if stiffness:
        robot.effects += (("spring", {"stiffness": stiffness, "rest": rest}),)


def _root(robot: RobotFile, tree: Tree, poses: Poses, names: Names) -> list[Branch]:
    """Choose the root link, and return the joints of the tree that are left."""
    floating = [root for root in tree.roots if root is not None]
    if len(tree.roots) == 1 and floating:
        robot.base, robot.base_home = "floating", home_pose(poses.world(floating[0]))
        robot.notes.append(
            "nothing joins the model to the world, so its base floats; to hold it, load it with "
            "base='fixed', or write a fixed joint with <parent>world</parent>"
        )
        names.root = floating[0].full_name
        return tree.branches
    held = [branch for branch in tree.branches if branch.above is None]
    if not floating and len(held) == 1 and _is_the_world(held[0], poses):
        names.root = names.link(held[0].below)
        return [branch for branch in tree.branches if branch is not held[0]]
    names.root = unique("world", names.links)
    names.links.add(names.root)
    robot.links.insert(0, Link(names.root, 0.0, np.zeros(3), np.zeros((3, 3))))
    for root in floating:
        name = unique(f"{root.full_name}_free", names.joints)
        names.joints.add(name)
        axis = np.array([1.0, 0.0, 0.0])
        robot.joints.append(Joint(name, "floating", names.root, root.full_name, np.eye(4), axis))
        robot.home[name] = home_pose(poses.world(root))
    return tree.branches


def _is_the_world(branch: Branch, poses: Poses) -> bool:
    """Check whether a joint to the world welds a link whose frame is that of the world."""
    return branch.joint.kind == "fixed" and np.array_equal(poses.world(branch.below), np.eye(4))


def _geared(joints: list[Stated], poses: Poses) -> set[Item]:
    """Return the joints between the links of gearboxes."""
    out: set[Item] = set()
    for gearbox in (joint for joint in joints if joint.kind == "gearbox"):
        ends = {reference_body(gearbox, poses), gearbox.parent, gearbox.child}
        out |= {joint.item for joint in joints if {joint.parent, joint.child} <= ends}
    return out


def _canonical(world: Scope, poses: Poses) -> Item | None:
    """Return the link that the model names as its canonical one, or None."""
    (model,) = world.items["model"].values()
    if model.inner is None or not str(model.inner.node.xml.get("canonical_link", "")).strip():
        return None
    return poses.link(model.inner, MODEL, model.node)
