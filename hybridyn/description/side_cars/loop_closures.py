"""Read `loop_closures.yaml`, with which exporters state the loops that they cut for a URDF.

scikit-robot and sw2robot write hinges, each with a point and an axis in the root link's frame where all
joints are at zero, and the joints that nothing solves for:

    closures: [{link_a: rod, link_b: rocker, point: [0.5, 0, 0.2], axis: [0, 1, 0]}, ...]
    dependent: [elbow, swing]
    independent: [drive]

robonex writes points in both links, axes in the parent's, joints that are balls, and the motors:

    pin_loops: [{name: pin, parent: rod, child: rocker, parent_xyz: [..], child_xyz: [..], axis: [0, 1, 0]}]
    ball_loops: [{name: ball, parent: rod, child: rocker, parent_xyz: [..], child_xyz: [..]}]
    ball_upgrades: [rod_joint]
    actuated_joints: [drive]
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from ...joints.kinds import JointKind
from ..closure_forms import FREE, closure_of
from ..names import unique
from ..placement import placement_from, poses_at_zero, relative, rotation_to_axis
from ..records import Array, Closure, MotorStatement, RobotFile
from ..urdf.xml_node import SMALLEST_AXIS
from .tables import Open, Point, table
from .yaml_file import Place, YamlFile, checked

Names = list[str]
Hinge: Any = table("Hinge", Open, link_a=str, link_b=str, point=Point, axis=Point | None)
Pin: Any = table("Pin", Open, name=str, parent=str, child=str, parent_xyz=Point, child_xyz=Point, axis=Point)
Ball: Any = table("Ball", Open, name=str, parent=str, child=str, parent_xyz=Point, child_xyz=Point)
#: Lists of closures, and for each the keys of its two links.
LOOPS = {
    "closures": ("link_a", "link_b"), "pin_loops": ("parent", "child"), "ball_loops": ("parent", "child"),
}  # fmt: skip
File: Any = table(
    "File", Open, closures=Annotated[list[Hinge], Field(min_length=1)] | None, pin_loops=list[Pin] | None,
    ball_loops=list[Ball] | None, dependent=Names | None, independent=Names | None,
    ball_upgrades=Names | None, actuated_joints=Names | None, ball_limit_deg=float | None,
)  # fmt: skip


def apply_loop_closures(robot: RobotFile, document: YamlFile) -> None:
    """Add the closures and motors of the file to the robot, and make its ball joints.

    Raises:
        ModelError: The file is wrong, states no loop, or names what the robot does not have.
    """
    name, content = Path(document.file).name, checked(document, File)
    stated = [(key, number, loop) for key in LOOPS for number, loop in enumerate(getattr(content, key) or ())]
    if not stated:
        raise document.error((), "states no loop: closures, pin_loops or ball_loops")
    links = {link.name for link in robot.links}
    if not any(link in links for key, _, loop in stated for link in _ends(key, loop)):
        robot.notes.append(f"{name} names no link of this robot, and was not read")
        return
    poses = poses_at_zero(robot.joints)
    for key, number, loop in stated:
        place: Place = (key, number)
        for word, link in zip(LOOPS[key], _ends(key, loop), strict=True):
            document.refuse_unknown((*place, word), [link], poses, "link")
        robot.closures.append(_closure(robot, document, place, loop, poses))
    joints = [joint.name for joint in robot.joints]
    for key in ("dependent", "independent", "ball_upgrades", "actuated_joints"):
        document.refuse_unknown((key,), getattr(content, key) or (), joints, "joint")
    balls = {*(content.ball_upgrades or ())}
    robot.joints = [
        replace(j, kind=JointKind.SPHERICAL, **FREE) if j.name in balls else j for j in robot.joints
    ]
    if content.ball_limit_deg is not None:
        robot.notes.append(f"ball_limit_deg of {name} is not read")
    robot.motors += _motors(robot, document, content)


def _ends(key: str, loop: Any) -> list[str]:
    """Return the names of the two links of a loop."""
    return [getattr(loop, word) for word in LOOPS[key]]


def _closure(
    robot: RobotFile, document: YamlFile, place: Place, loop: Any, poses: Mapping[str, Array]
) -> Closure:
    """Return one loop as a closure: a hinge, or a ball where no axis is stated."""
    links, axis = _ends(str(place[0]), loop), getattr(loop, "axis", None)
    turn, kind = np.eye(3), JointKind.SPHERICAL
    if axis is not None:
        size = float(np.linalg.norm(axis))
        if size < SMALLEST_AXIS:
            raise document.error((*place, "axis"), "is zero, so it has no direction")
        turn, kind = rotation_to_axis(np.array(axis) / size), JointKind.REVOLUTE
    if place[0] == "closures":
        at = placement_from(np.eye(3), np.array(loop.point))
        frames = [relative(poses[link], at) for link in links]
    else:
        between = relative(poses[links[1]], poses[links[0]])[:3, :3]
        points = np.array(loop.parent_xyz), np.array(loop.child_xyz)
        frames = [placement_from(*pair) for pair in zip((np.eye(3), between), points, strict=True)]
    stated = getattr(loop, "name", "-".join(links))
    name = unique(stated, {closure.name for closure in robot.closures})
    sides = zip(links, frames, strict=True)
    return closure_of(name, kind, sides, (turn, turn), line=document.lines[place][0])


def _motors(robot: RobotFile, document: YamlFile, content: Any) -> Iterator[MotorStatement]:
    """Yield the motors that the file states.

    The exporters let the independent joints keep their actuators: all that move, but those solved for.
    """
    followers = {coupling.name for coupling in robot.couplings}
    freedoms = {joint.name: joint.kind.nv for joint in robot.joints}
    for key in ("actuated_joints", "independent"):
        if names := getattr(content, key):
            driven = tuple(name for name in names if freedoms[name] == 1 and name not in followers)
            where = f"{key} of {Path(document.file).name}"
            yield MotorStatement("independent", where, driven, document.file, document.lines[(key,)][0])
