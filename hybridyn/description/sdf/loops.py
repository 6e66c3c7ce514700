"""Joints of an SDF file that close loops, as closures."""

from __future__ import annotations

import numpy as np

from ..closure_forms import FORMS
from ..mjcf.naming import unique
from ..names import listed
from ..placement import inverse, rotation_to_axis, turned
from ..records import Closure, Link
from ..robot_file import RobotFile
from .chains import Names, add_chain, tidy
from .graph import KEPT, Branch
from .joints import Stated
from .poses import Poses
from .scopes import Item

#: Closures by the type of the joint.
KINDS = {
    "fixed": "fixed", "revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic",
    "ball": "spherical", "universal": "universal",
}  # fmt: skip


def add_loops(robot: RobotFile, cut: list[tuple[Stated, int]], poses: Poses, names: Names) -> None:
    """Add the joints that close loops to the robot, and note which they are.

    A joint with a position that something needs (a motor, a spring, a coupling) stays a joint: it carries a
    massless link, and a fixed closure welds that to its child.
    """
    whole: list[str] = []
    limited: list[str] = []
    welded: list[str] = []
    for stated, weight in cut:
        if stated.kind in KINDS and (weight < KEPT or stated.kind == "fixed"):
            robot.closures.append(_closure(stated, poses, names, robot))
            whole.append(stated.name)
            if any(axis.limited for axis in stated.axes):
                limited.append(stated.name)
        else:
            robot.closures.append(_welded(robot, stated, poses, names))
            welded.append(stated.name)
    if whole:
        robot.notes.append(f"loops are cut at joints {listed(whole)}, which are closures")
    if welded:
        robot.notes.append(
            f"loops are cut behind joints {listed(welded)}: each carries a massless link, which a closure "
            "welds to its child"
        )
    if limited:
        robot.notes.append(
            f"limits of closures are not read: {listed(limited)}; to keep them, cut another joint of the "
            "loop (<physics><simbody><must_be_loop_joint>true)"
        )


def _closure(stated: Stated, poses: Poses, names: Names, robot: RobotFile) -> Closure:
    kind = KINDS[stated.kind]
    form = FORMS[kind]
    first = second = np.eye(3)
    if form.has_axis:
        first, second = (
            rotation_to_axis(tidy(stated.at[:3, :3].T @ axis.direction))
            for axis in (stated.axes[0], stated.axes[-1])
        )
    at_a = inverse(poses.world(stated.parent)) @ stated.at if stated.frame_a is None else stated.frame_a
    at_b = inverse(poses.world(stated.child)) @ stated.at
    return Closure(
        stated.name, kind, names.link(stated.parent), turned(at_a, first), names.link(stated.child),
        turned(at_b, second), form.translations, form.rotation, _line(stated.item, robot), first,
    )  # fmt: skip


def _welded(robot: RobotFile, stated: Stated, poses: Poses, names: Names) -> Closure:
    """Add a joint with a massless link, and return the closure that welds this to the joint's child."""
    branch = Branch(stated, stated.child is not None)
    target = unique(f"{names.link(branch.below)}_at_{stated.name}", names.links)
    names.links.add(target)
    add_chain(robot, branch, target, poses, names)
    robot.links.append(Link(target, 0.0, np.zeros(3), np.zeros((3, 3)), _line(stated.item, robot), True))
    taken = {closure.name for closure in robot.closures}
    return Closure(
        unique(f"{stated.name}_closure", taken), "fixed", target, np.eye(4), names.link(branch.below),
        np.eye(4), FORMS["fixed"].translations, FORMS["fixed"].rotation, _line(stated.item, robot),
    )  # fmt: skip


def _line(item: Item, robot: RobotFile) -> int | None:
    return item.node.line if item.node.file == robot.file else None
