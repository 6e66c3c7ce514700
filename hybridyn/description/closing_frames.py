"""Build the closures that onshape-to-robot states by the names of frames.

A mate that closes a loop becomes two frames, `closing_<x>_1` and `closing_<x>_2`. A revolute mate has two
more, `closing_<x>_1_z` and `closing_<x>_2_z`, on its axis: two pairs of points that coincide are a hinge.
URDF does not say whether a mate without them is a ball or fastened; it is read as a ball, unless `[closures]`
of model.toml says "fixed".
"""

from __future__ import annotations

import re

import numpy as np

from ..errors import ModelError
from .closure_forms import FORMS
from .names import listed
from .placement import placement_from, rotation_to_axis
from .poses import poses_at_zero, relative
from .records import Array, Closure, Joint
from .robot_file import RobotFile

FRAME = re.compile(r"closing_(.+)_([12])(_z)?")

#: Largest relative difference of the distances to the two points on an axis: files print them with 6 digits.
SAME_DISTANCE = 1e-5


def apply_closing_frames(robot: RobotFile) -> None:
    """Add a closure for each pair of closing frames that no other closure uses.

    Raises:
        ModelError: The frames of a mate are incomplete, or those on its axis contradict each other.
    """
    frames = {joint.name: joint.child for joint in robot.joints if joint.kind == "fixed"}
    frames |= {link.name: link.name for link in robot.links}
    used = {link for closure in robot.closures for link in (closure.link_a, closure.link_b)}
    mates: dict[str, dict[str, str]] = {}
    for name, link in frames.items():
        if (match := FRAME.fullmatch(name)) and link not in used:
            mates.setdefault(match[1], {})[match[2] + (match[3] or "")] = link
    balls = []
    for name, ends in mates.items():
        if not {"1", "2"} <= ends.keys():
            continue
        closure = _closure(robot, name, ends)
        robot.closures.append(closure)
        if closure.rotation == "free":
            balls.append(closure.name)
    if balls:
        robot.notes.append(
            f"closing frames {listed(balls)} are read as balls: the file states no axis "
            "(closing_.._1_z); if the mate is fastened, write "
            f'{balls[0]} = "fixed" under [closures] in model.toml'
        )


def _closure(robot: RobotFile, name: str, ends: dict[str, str]) -> Closure:
    """Return the closure of one mate."""
    title = f"closing_{name}"
    lines = {link.name: link.line for link in robot.links}
    axes = [key for key in ("1_z", "2_z") if key in ends]
    if not axes:
        form, kind = FORMS["spherical"], "spherical"
        frames = [np.eye(4), np.eye(4)]
    elif len(axes) == 1:
        raise ModelError(
            f"frame '{ends[axes[0]]}' states the axis of {title} on one side only; "
            f"frame '{title}_{'2_z' if axes[0] == '1_z' else '1_z'}' is missing",
            file=robot.file, line=lines[ends[axes[0]]], element=ends[axes[0]],
        )  # fmt: skip
    else:
        form, kind = FORMS["revolute"], "revolute"
        frames = _on_axis(robot, title, ends, lines)
    return Closure(
        title, kind, ends["1"], frames[0], ends["2"], frames[1], form.translations, form.rotation,
        lines[ends["1"]], frames[0][:3, :3],
    )  # fmt: skip


def _on_axis(robot: RobotFile, title: str, ends: dict[str, str], lines: dict[str, int | None]) -> list[Array]:
    """Return the two frames of a hinge, their z towards the second point of each side."""
    poses, above = poses_at_zero(robot.joints), {joint.child: joint for joint in robot.joints}
    frames, distances = [], []
    for end in ("1", "2"):
        link, other = ends[end], ends[f"{end}_z"]
        if _body(link, above) != _body(other, above):
            raise ModelError(
                f"frames '{link}' and '{other}' stand on two bodies; they state the axis of {title}",
                file=robot.file, line=lines[other], element=other,
            )  # fmt: skip
        way = relative(poses[link], poses[other])[:3, 3] if {link, other} <= poses.keys() else np.zeros(3)
        distances.append(float(np.linalg.norm(way)))
        if not distances[-1]:
            raise ModelError(
                f"frames '{link}' and '{other}' coincide, so they state no axis of {title}",
                file=robot.file, line=lines[other], element=other,
            )  # fmt: skip
        frames.append(placement_from(rotation_to_axis(way / distances[-1]), np.zeros(3)))
    if abs(distances[0] - distances[1]) > SAME_DISTANCE * distances[0]:
        raise ModelError(
            f"the points on the axis of {title} are {distances[0]:g} m and {distances[1]:g} m from its "
            "frames; they cannot both coincide",
            file=robot.file, line=lines[ends["1_z"]], element=ends["1_z"],
        )  # fmt: skip
    return frames


def _body(link: str, above: dict[str, Joint]) -> str:
    """Return the first link of the rigid body that a link belongs to."""
    seen: set[str] = set()
    while link in above and above[link].kind == "fixed" and link not in seen:
        seen.add(link)
        link = above[link].parent
    return link
