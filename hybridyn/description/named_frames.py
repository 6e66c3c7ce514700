"""Build the closures that the names of frames state, where the file itself states none.

A mate of onshape-to-robot that closes a loop becomes two frames, `closing_<x>_1` and `closing_<x>_2`.
A revolute mate has two more, `closing_<x>_1_z` and `closing_<x>_2_z`, on its axis: two pairs of points that
coincide are a hinge. URDF does not say whether a mate without them is a ball or fastened; it is read as a
ball, unless `[closures]` of model.toml says "fixed".
"""

from __future__ import annotations

import re

import numpy as np

from ..errors import ModelError
from .closure_forms import FORMS, closure_of
from .groups import Groups
from .names import listed
from .placement import poses_at_zero, relative, rotation_to_axis
from .records import Array, Closure, RobotFile

CLOSURE_TYPES = {"3d": FORMS["point"], "6d": FORMS["fixed"]}
CLOSING = re.compile(r"closing_(.+)_([12](?:_z)?)")

#: Largest relative difference of the distances to the two points on an axis: files print them with 6 digits.
SAME_DISTANCE = 1e-5


def weld_or_point(name: str, kind: str, link_a: str, link_b: str, line: int | None) -> Closure:
    """Return the closure that makes the origins (3d) or the whole frames (6d) of two links coincide."""
    sides = (link_a, np.eye(4)), (link_b, np.eye(4))
    return closure_of(name, kind, sides, form=CLOSURE_TYPES[kind], line=line)


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
        if (match := CLOSING.fullmatch(name)) and link not in used:
            mates.setdefault(f"closing_{match[1]}", {})[match[2]] = link
    added = [_mate(robot, title, ends) for title, ends in mates.items() if {"1", "2"} <= ends.keys()]
    robot.closures += added
    balls = [closure.name for closure in added if closure.rotation == "free"]
    if balls:
        robot.notes.append(
            f"closing frames {listed(balls)} are read as balls: the file states no axis "
            "(closing_.._1_z); if the mate is fastened, write "
            f'{balls[0]} = "fixed" under [closures] in model.toml'
        )


def _mate(robot: RobotFile, title: str, ends: dict[str, str]) -> Closure:
    """Return the closure of one mate: a ball, or a hinge with z towards the second point of each side."""
    sides = [(ends[key], np.eye(4)) for key in ("1", "2")]
    line = next(link.line for link in robot.links if link.name == ends["1"])
    if len(ends) == 2:
        return closure_of(title, "spherical", sides, line=line)
    return closure_of(title, "revolute", sides, _turns(robot, title, ends), line=line)


def _turns(robot: RobotFile, title: str, ends: dict[str, str]) -> list[Array]:
    """Return the axes of the frames of a hinge on both links, shapes (3, 3).

    Raises:
        ModelError: A second point is missing, on another body or at the first, or the distances differ.
    """
    lines = {link.name: link.line for link in robot.links}
    poses, bodies = poses_at_zero(robot.joints), _bodies(robot)
    ways: list[Array] = []

    def wrong(key: str, message: str) -> ModelError:
        """Return the error of a frame, with its line."""
        return ModelError(message, file=robot.file, line=lines[ends[key]], element=ends[key])

    for key, across in (("1", "2"), ("2", "1")):
        if f"{across}_z" not in ends:
            raise wrong(
                f"{key}_z",
                f"frame '{ends[f'{key}_z']}' states the axis of {title} on one side only; "
                f"frame '{title}_{across}_z' is missing",
            )
    for link, key in ((ends["1"], "1_z"), (ends["2"], "2_z")):
        if bodies.of(link) != bodies.of(ends[key]):
            message = f"frames '{link}' and '{ends[key]}' stand on two bodies; they state the axis of {title}"
            raise wrong(key, message)
        inside = {link, ends[key]} <= poses.keys()
        ways.append(relative(poses[link], poses[ends[key]])[:3, 3] if inside else np.zeros(3))
        if not np.linalg.norm(ways[-1]):
            raise wrong(key, f"frames '{link}' and '{ends[key]}' coincide, so they state no axis of {title}")
    one, two = (float(np.linalg.norm(way)) for way in ways)
    if abs(one - two) > SAME_DISTANCE * one:
        raise wrong(
            "1_z",
            f"the points on the axis of {title} are {one:g} m and {two:g} m from its frames; they cannot "
            "both coincide",
        )
    return [rotation_to_axis(ways[0] / one), rotation_to_axis(ways[1] / two)]


def _bodies(robot: RobotFile) -> Groups[str]:
    """Return the groups of links that fixed joints weld together."""
    out: Groups[str] = Groups()
    for joint in robot.joints:
        if joint.kind == "fixed":
            out.join(joint.parent, joint.child)
    return out
