"""Define the closures that files name ("revolute", "rows", ...), and build those that frames' names state.

A mate of onshape-to-robot that closes a loop becomes two frames, `closing_<x>_1` and `closing_<x>_2`.
A revolute mate has two more, `closing_<x>_1_z` and `closing_<x>_2_z`, on its axis: two pairs of points that
coincide are a hinge. URDF does not say whether a mate without them is a ball or fastened; it is read as a
ball, unless `[closures]` of model.toml says "fixed".

Where nothing else closes a loop, pairs with other names count, too: `loop_<x>_1`, `loop_<x>_2`, and
`<x>_cut_1`, `<x>_cut_2`, in the same way (the ends may be a and b); and Gepetto's `closedloop<N>`, two frames
for each N, which are welded.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ..errors import ModelError
from ..joints.kinds import JointKind, RotationKind
from .groups import Groups
from .joint_words import CYLINDRICAL, POINT, UNIVERSAL, WORDS
from .names import listed
from .placement import poses_at_zero, relative, rotation_to_axis, turned
from .records import Array, Closure, MotorStatement, RobotFile

#: Every translation.
FULL = (0, 1, 2)
#: One side of a closure: link, and the frame placed on it by the author, shape (4, 4).
Side = tuple[str, Array]


class Form(NamedTuple):
    """The translations and rotations that a kind of closure locks; its axis is z.

    Attributes:
        translations: Axes of frame A along which B's origin may not move.
        rotation: The locked part of the rotation.
        has_axis: Whether this kind of closure has an axis.
        rotation_of_frames: Rotation of both frames about their own axes that brings the closure into this
            form, shape (3, 3).
    """

    translations: tuple[int, ...]
    rotation: RotationKind
    has_axis: bool = True
    rotation_of_frames: Array = np.eye(3)


#: Rows of a general closure: translations along and rotations about the axes of the predecessor frame.
ROWS = ("tx", "ty", "tz", "rx", "ry", "rz")
#: The rotation row of a universal joint: the third axes of both frames stay perpendicular.
PERPENDICULAR = "perpendicular"
#: The rows that lock a part of the rotation.
TURNS_HELD: dict[RotationKind, tuple[str, ...]] = {
    "free": (), "perpendicular": (PERPENDICULAR,), "parallel": ROWS[3:5], "fixed": ROWS[3:],
}  # fmt: skip


def _forms() -> dict[str, Form]:
    """Return the closures by name, those with more rows before others; a joint that holds nothing is none."""
    held = {kind.value: form for kind in WORDS if (form := kind.closure)}
    held |= {CYLINDRICAL: ((0, 1), "parallel"), UNIVERSAL: (FULL, "perpendicular"), POINT: (FULL, "free")}
    rows = {name: len(axes) + len(TURNS_HELD[rotation]) for name, (axes, rotation) in held.items()}
    return {
        name: Form(*held[name], has_axis=held[name] not in ((FULL, "fixed"), (FULL, "free")))
        for name in sorted(held, key=lambda name: -rows[name])
        if rows[name]
    }


#: Closures by name.
FORMS = _forms()

#: Largest cosine between the axes of a universal joint in a file: files keep 5 or 6 digits.
LARGEST_COSINE = 1e-5
#: Axes of the second frame in the first one where a follower of MJCF has a universal closure at zero.
SIDEWAYS = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])

SINGLE_ROTATION = (
    "a single rotation row is not holonomic, so it closes no loop by itself; "
    'lock two (the remaining axes stay parallel), three or none, or use type="universal" '
    "(two axes kept perpendicular)"
)


def closure_of(
    name: str,
    kind: str,
    sides: Iterable[Side],
    turns: Sequence[Array] = (np.eye(3),) * 2,
    form: Form | None = None,
    line: int | None = None,
) -> Closure:
    """Return the closure of a kind.

    Args:
        name: Its name.
        kind: Its kind, a key of `FORMS` where no form is given.
        sides: Both sides.
        turns: Rotations of both frames about their own axes that map z to the closure's axis, shapes (3, 3).
        form: Its form, where that is not the one of its kind.
        line: Line in the file, or None.
    """
    form, kind = form or FORMS[kind], str(kind)
    (link_a, at_a), (link_b, at_b) = sides
    frames = turned(at_a, turns[0]), turned(at_b, turns[1])
    return Closure(
        name, kind, link_a, frames[0], link_b, frames[1], form.translations, form.rotation, line, turns[0]
    )


def form_of_rows(text: str) -> Form:
    """Convert `rows="tx ty rx ry"` to canonical form by a cyclic permutation of the frames' axes.

    Two locked rotations leave the third axes of both frames parallel; that axis becomes z.

    Raises:
        ValueError: A row is unknown or repeated, there is no row, or a single rotation is locked.
    """
    words = text.split()
    for word in words:
        if word not in (*ROWS, PERPENDICULAR):
            raise ValueError(f"unknown row '{word}'; rows are {' '.join((*ROWS, PERPENDICULAR))}")
    if len(set(words)) != len(words):
        raise ValueError("a row is stated twice")
    if not words:
        raise ValueError("no row is stated, so nothing is closed")
    locked, turns = ([axis for axis in range(3) if kind + "xyz"[axis] in words] for kind in "tr")
    if PERPENDICULAR in words and turns:
        raise ValueError(f"'{PERPENDICULAR}' is the only rotation row that may be stated with itself")
    if len(turns) == 1:
        raise ValueError(SINGLE_ROTATION)
    if len(turns) == 2:
        z = ({0, 1, 2} - set(turns)).pop()
        order = [(z + 1) % 3, (z + 2) % 3, z]
        translations = tuple(sorted(order.index(axis) for axis in locked))
        return Form(translations, "parallel", rotation_of_frames=np.eye(3)[:, order])
    return Form(tuple(locked), "perpendicular" if PERPENDICULAR in words else "fixed" if turns else "free")


def words_of_rows(translations: tuple[int, ...], rotation: RotationKind) -> list[str]:
    """Return the rows of a closure in canonical form, the inverse of `form_of_rows`."""
    return [ROWS[axis] for axis in translations] + [*TURNS_HELD[rotation]]


#: Numbers of a joint without limits.
FREE: dict[str, Any] = {"lower": -np.inf} | dict.fromkeys(("upper", "velocity", "effort"), np.inf)
CLOSING = re.compile(r"(?P<name>closing_.+)_(?P<end>[12](?:_z)?)")
#: Names of pairs that count where nothing else closes a loop.
PAIRS = re.compile(r"(?P<name>loop_.+|.+_cut|(?:.+_)?cut_.+)_(?P<end>[12abAB](?:_z)?)")
ENDS = {"a": "1", "b": "2"}
#: A link of at most this mass is a frame [kg]: exporters write 1e-9 kg where a simulator forbids zero.
MASS_OF_FRAME = 1e-6
WELDED = re.compile(r"(?:closedloop|fermeture)(\d+)", re.IGNORECASE)

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
    free = {name: link for name, link in frames.items() if link not in used}
    added = _mates(robot, free, CLOSING)
    if not robot.closures and not added:
        added = _mates(robot, _bare(robot, free), PAIRS)
    robot.closures += added
    balls = [closure.name for closure in added if closure.rotation == "free"]
    if balls:
        robot.notes.append(
            f"closing frames {listed(balls)} are read as balls: the file states no axis "
            f"({balls[0]}_1_z); if the mate is fastened, write "
            f'{balls[0]} = "fixed" under [closures] in model.toml'
        )


def apply_welded_frames(robot: RobotFile) -> None:
    """Add the closures, balls and motors of Gepetto's names, in a robot that states no closure.

    Frames of the same `closedloop<N>` are welded; hinges named `spherical` are balls; joints named `motor`
    are driven.
    """
    if robot.closures:
        return
    pairs: dict[str, dict[str, None]] = {}
    frames = [(link.name, link.name) for link in robot.links] + [(j.name, j.child) for j in robot.joints]
    for name, link in frames:
        if match := WELDED.search(name):
            pairs.setdefault(match[1], {})[link] = None
    if not pairs or any(len(links) != 2 for links in pairs.values()):
        return  # nothing says which of them close a loop, which `refuse_unclosed_frames` tells
    for links in pairs.values():
        sides = [(link, np.eye(4)) for link in links]
        robot.closures.append(closure_of("-".join(links), "6d", sides, form=FORMS["fixed"]))
    _name_balls_and_motors(robot)


def _name_balls_and_motors(robot: RobotFile) -> None:
    """Make hinges named `spherical` balls, and joints named `motor` motors, as Gepetto's reader does."""
    balls = {joint.name for joint in robot.joints if JointKind.SPHERICAL in joint.name and joint.kind.hinge}
    robot.joints = [
        replace(joint, kind=JointKind.SPHERICAL, **FREE) if joint.name in balls else joint
        for joint in robot.joints
    ]
    motors = tuple(joint.name for joint in robot.joints if "motor" in joint.name and joint.kind.single)
    if motors:
        where = "joints that are named 'motor', as in Gepetto's models"
        robot.motors.append(MotorStatement("names", where, motors, robot.file))
    robot.notes.append(
        f"no side-car: frames named closedloop are welded pairwise, {len(balls)} joints named spherical are "
        "balls"
    )


def _bare(robot: RobotFile, frames: Mapping[str, str]) -> dict[str, str]:
    """Return the frames that are links on a fixed joint, without mass and with nothing on them."""
    masses = {link.name: link.mass for link in robot.links}
    fixed = {joint.child for joint in robot.joints if joint.kind == "fixed"}
    bare = fixed - {joint.parent for joint in robot.joints}
    return {
        name: link for name, link in frames.items() if link in bare and masses.get(link, 0.0) <= MASS_OF_FRAME
    }


def _mates(robot: RobotFile, frames: Mapping[str, str], names: re.Pattern[str]) -> list[Closure]:
    """Return the closures of the frames whose names match in pairs."""
    mates: dict[str, dict[str, str]] = {}
    for name, link in frames.items():
        if match := names.fullmatch(name):
            end = match["end"].lower()
            mates.setdefault(match["name"], {})[ENDS.get(end[0], end[0]) + end[1:]] = link
    bodies = Groups((joint.parent, joint.child) for joint in robot.joints if joint.kind == "fixed")
    return [
        _mate(robot, title, ends)
        for title, ends in mates.items()
        if {"1", "2"} <= ends.keys() and (names is CLOSING or bodies.of(ends["1"]) != bodies.of(ends["2"]))
    ]


def _mate(robot: RobotFile, title: str, ends: dict[str, str]) -> Closure:
    """Return the closure of one mate: a ball, or a hinge with z towards the second point of each side."""
    sides = [(ends[key], np.eye(4)) for key in ("1", "2")]
    line = next((link.line for link in robot.links if link.name == ends["1"]), None)
    if len(ends) == 2:
        return closure_of(title, JointKind.SPHERICAL, sides, line=line)
    return closure_of(title, JointKind.REVOLUTE, sides, _turns(robot, title, ends), line=line)


def _turns(robot: RobotFile, title: str, ends: dict[str, str]) -> list[Array]:
    """Return the axes of the frames of a hinge on both links, shapes (3, 3).

    Raises:
        ModelError: A second point is missing, on another body or at the first, or the distances differ.
    """
    lines = {link.name: link.line for link in robot.links}
    poses = poses_at_zero(robot.joints)
    bodies = Groups((joint.parent, joint.child) for joint in robot.joints if joint.kind == "fixed")
    ways: list[Array] = []

    def wrong(key: str, message: str) -> ModelError:
        """Return the error of a frame, with its line."""
        return ModelError(message, file=robot.file, line=lines.get(ends[key]), element=ends[key])

    for missing in {"1_z", "2_z"} - ends.keys():
        raise wrong(
            "1",
            f"a frame states the axis of {title} on one side only; frame '{title}_{missing}' is missing",
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
