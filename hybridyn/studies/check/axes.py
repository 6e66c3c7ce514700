"""Check the axes of hinges in loops, and loops that are stated twice.

About a loop the rotations of its joints make up none. If all its hinges but one are parallel, that one turns
by the part of the rotation that is not about their axis, which is none: it can never turn. Such a hinge is
the sign of an axis that was forgotten or written in another frame, as of a plane mechanism one of whose axes
is not the normal of the plane. Of other loops the motors tell: if a module has fewer freedoms than motors,
and just as many with one of its hinges turned along another one or through the point in which the others
meet, that hinge is called wrong.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ...description.loop_signs import WeldedBodies
from ...description.names import counted, listed
from ...description.placement import inverse, poses_at, rotation_to_axis, turned
from ...description.records import Closure, Description, Joint
from ...errors import HybridynError
from ...spatial import Array
from ...structure.building import rebuilt
from ...structure.module import Module
from ...structure.robot import HybridRobot
from .finding import Finding
from .subject import Subject

#: Axes are parallel if the sine of their angle is below this; files keep four digits and more.
SAME_AXIS = 1e-3
#: Kinds of joints that are hinges.
#: Fewest hinges of a loop that must be parallel for another one to be called wrong.
FEWEST = 2
#: Ends of two closures are in the same place if they differ by less than this part of the robot's size.
SAME_END = 1e-6


class _Hinge(NamedTuple):
    """A hinge of a loop.

    Attributes:
        of: Its joint or closure.
        axis: Its axis at home in the root link, shape (3,).
        at: A point of the axis at home in the root link [m], shape (3,).
    """

    of: Joint | Closure
    axis: Array
    at: Array


def check_axes(subject: Subject) -> Iterator[Finding]:
    """Find hinges that can never turn, since all others of their loop are parallel; each hinge once.

    If there are none, find the modules in which the axis of a hinge takes freedoms that the motors ask for.
    """
    description = subject.description
    poses = poses_at(description, description.home)
    known = set[str]()
    for closure in description.closures:
        hinges, slides = _hinges(subject, closure, poses)
        for across in hinges:
            others = [hinge for hinge in hinges if hinge is not across]
            if across.of.name in known or len(others) < FEWEST or not _odd(across, others):
                continue
            if isinstance(across.of, Joint) and any(_parallel(across.axis, slide) for slide in slides):
                continue  # a cylinder, which is there to slide
            known.add(across.of.name)
            yield _across(subject, across, others, poses)
    if not known and subject.robot is not None:
        for module in subject.robot.modules:
            yield from _too_few_freedoms(subject, subject.robot, module, poses)


def _too_few_freedoms(
    subject: Subject, robot: HybridRobot, module: Module, poses: dict[str, Array]
) -> Iterator[Finding]:
    """Find the hinges that give a module of too few freedoms one per motor if their axes are turned."""
    missing = len(module.motors) - module.mobility
    if missing <= 0:
        return
    closures = [one for one in subject.description.closures if one.name in module.closures]
    turning = {one.of.name: one for closure in closures for one in _turning(subject, closure, poses)}
    found = [
        (one, axis)
        for one in sorted(turning.values(), key=lambda hinge: isinstance(hinge.of, Joint))
        for axis in _candidates(
            one, [hinge for hinge in turning.values() if hinge is not one], subject.extent
        )
        if _mobility_with(subject, robot, one.of, axis, poses) == robot.mobility + missing
    ]
    if found:
        yield _taken(subject, module, found, poses)


def _candidates(one: _Hinge, others: list[_Hinge], size: float) -> Iterator[Array]:
    """Yield axes that a hinge may have been meant to have: those of others, or through where they meet."""
    found = [one.axis]
    for axis in [hinge.axis for hinge in others] + _to_meeting_point(one, others, size):
        if not any(_parallel(axis, known) for known in found):
            found.append(axis)
            yield axis


def _to_meeting_point(one: _Hinge, others: list[_Hinge], size: float) -> list[Array]:
    """Return the direction from a hinge to the point in which the axes of the others meet, if they do."""
    across = [np.eye(3) - np.outer(hinge.axis, hinge.axis) for hinge in others]
    if not across:
        return []
    rows, at = np.vstack(across), np.concatenate([P @ x.at for P, x in zip(across, others, strict=True)])
    point, _, rank, _ = np.linalg.lstsq(rows, at, rcond=SAME_AXIS)
    way = point - one.at
    far = float(np.linalg.norm(way))
    missed = float(np.abs(rows @ point - at).max())
    return [way / far] if rank == 3 and far > SAME_AXIS * size and missed < SAME_AXIS * size else []


def _hinges(subject: Subject, closure: Closure, poses: dict[str, Array]) -> tuple[list[_Hinge], list[Array]]:
    """Return the hinges of a closure's loop and the directions of its slides.

    There are none where the loop also turns otherwise. A closure that slides and turns is no hinge of which
    one may say that it should turn.
    """
    joints = [joint for joint in _loop(subject, closure) if not joint.kind.hinge and joint.kind.nv]
    if any(not joint.kind.slides for joint in joints) or not (_is_hinge(closure) or _is_fixed(closure)):
        return [], []
    return _turning(subject, closure, poses), [poses[joint.child][:3, :3] @ joint.axis for joint in joints]


def _turning(subject: Subject, closure: Closure, poses: dict[str, Array]) -> list[_Hinge]:
    """Return the hinges of a closure's loop."""
    out = list[_Hinge]()
    for joint in _loop(subject, closure):
        if joint.kind.hinge:
            frame = poses[joint.child]
            out.append(_Hinge(joint, frame[:3, :3] @ joint.axis, frame[:3, 3]))
    if _is_hinge(closure):
        frame = poses[closure.link_a] @ closure.frame_a
        out.append(_Hinge(closure, frame[:3, 2], frame[:3, 3]))
    return out


def _is_hinge(closure: Closure) -> bool:
    return closure.rotation == "parallel" and closure.translations == (0, 1, 2)


def _is_fixed(closure: Closure) -> bool:
    return closure.rotation == "fixed"


def _loop(subject: Subject, closure: Closure) -> list[Joint]:
    """Return the joints between the two links of a closure."""
    ways = []
    for link in (closure.link_a, closure.link_b):
        way = dict[str, Joint]()
        while link in subject.joint_above:
            joint = subject.joint_above[link]
            way[joint.name], link = joint, joint.parent
        ways.append(way)
    first, second = ways
    return [joint for way in ways for name, joint in way.items() if (name in first) != (name in second)]


def _odd(across: _Hinge, others: list[_Hinge]) -> bool:
    """Check whether some hinges are parallel, and another one is not parallel to them."""
    first, *rest = (hinge.axis for hinge in others)
    return all(_parallel(first, axis) for axis in rest) and not _parallel(first, across.axis)


def _parallel(a: Array, b: Array) -> bool:
    return float(np.linalg.norm(np.cross(a, b))) < SAME_AXIS


def _across(subject: Subject, across: _Hinge, others: list[_Hinge], poses: dict[str, Array]) -> Finding:
    """Return the finding of a hinge that can never turn."""
    (one, own, _), normal, robot = across, others[0].axis, subject.robot
    would = None if robot is None else _mobility_with(subject, robot, one, normal, poses)
    more = ""
    if robot is not None and would not in (None, robot.mobility):
        motors, freedoms = counted(len(robot.motors), "motor"), counted(would, "freedom")
        more = f"; if it were, too, the robot would have {freedoms}, not {robot.mobility} ({motors})"
    message = (
        f"it can never turn: its axis is at {_degrees(own, normal):.3g} degrees to those of "
        f"{_listed(others)}, the other hinges of its loop, which are parallel{more}"
    )
    why = "the loop has fewer freedoms than its hinges allow, and may close nowhere or be locked"
    mend = (
        "if it should turn like them, state its axis in its own frame: "
        f"{_in_own_frame(across, normal, poses)}; {_left_out(subject)}"
    )
    if isinstance(one, Joint):
        return subject.of_joint("axis-across", one.name, message, why, mend)
    return Finding("axis-across", _named(one), message, why, mend, *subject.first_place([one.name]))


def _taken(
    subject: Subject, module: Module, found: list[tuple[_Hinge, Array]], poses: dict[str, Array]
) -> Finding:
    """Return the finding of a module whose motors ask for freedoms that one of some axes takes."""
    motors, freedoms = counted(len(module.motors), "motor"), counted(module.mobility, "freedom")
    ways = "; ".join(f"of {_named(one.of)}: {_in_own_frame(one, axis, poses)}" for one, axis in found)
    return subject.of_module(
        "axis-across", module.name,
        f"an axis of its loops may be wrong: it has {freedoms} for {motors}, and one for each motor if one "
        f"axis is turned ({counted(len(found), 'way')})",
        "a module with fewer freedoms than motors is locked, or its motors work against each other",
        f"nothing if that is meant; or else state one axis, in its own frame: {ways}; {_left_out(subject)}",
        tuple(one.of.name for one, _ in found),
    )  # fmt: skip


def _in_own_frame(hinge: _Hinge, axis: Array, poses: dict[str, Array]) -> str:
    """Write an axis, given in the root link at home, in the frame in which a hinge states it."""
    one = hinge.of
    frame = poses[one.child] if isinstance(one, Joint) else poses[one.link_a] @ one.frame_a
    wanted = (frame[:3, :3] if isinstance(one, Joint) else frame[:3, :3] @ one.turn.T).T @ axis
    return " ".join(f"{x:.6g}" for x in np.round(wanted, 9) + 0.0)


def _left_out(subject: Subject) -> str:
    default = "x" if subject.description.format == "URDF" else "the default of the format"
    return f"an axis that is left out is {default}"


def _named(one: Joint | Closure) -> str:
    return f"{'joint' if isinstance(one, Joint) else 'closure'} '{one.name}'"


def _listed(hinges: list[_Hinge]) -> str:
    return listed(hinge.of.name for hinge in hinges)


def _degrees(a: Array, b: Array) -> float:
    """Return the angle between two lines [degrees]."""
    return float(np.degrees(np.arccos(min(1.0, abs(float(a @ b))))))


def _mobility_with(
    subject: Subject, robot: HybridRobot, one: Joint | Closure, axis: Array, poses: dict[str, Array]
) -> int | None:
    """Return the freedoms of the robot with a hinge's axis along another one, or None if it is no robot."""
    try:
        return rebuilt(robot, _with_axis(subject.description, one, axis, poses)).mobility
    except HybridynError:
        return None


def _with_axis(
    description: Description, one: Joint | Closure, normal: Array, poses: dict[str, Array]
) -> Description:
    """Return the description with the axis of one hinge along a direction of the root link at home."""
    if isinstance(one, Joint):
        joint = replace(one, axis=poses[one.child][:3, :3].T @ normal)
        return replace(description, joints=tuple(joint if x is one else x for x in description.joints))
    frames = [
        turned(frame, rotation_to_axis((poses[link] @ frame)[:3, :3].T @ normal))
        for link, frame in ((one.link_a, one.frame_a), (one.link_b, one.frame_b))
    ]
    closure = replace(one, frame_a=frames[0], frame_b=frames[1])
    return replace(description, closures=tuple(closure if x is one else x for x in description.closures))


def check_same_loops(subject: Subject) -> Iterator[Finding]:
    """Find closures that state the same loop under two names."""
    bodies, size = WeldedBodies(subject.description), subject.extent
    for first, second in itertools.combinations(subject.description.closures, 2):
        if (first.translations, first.rotation) != (second.translations, second.rotation):
            continue
        ends = [
            {bodies.of[link]: bodies.placement[link] @ frame for link, frame in _sides(closure)}
            for closure in (first, second)
        ]
        if ends[0].keys() == ends[1].keys() and all(
            _same(ends[0][body], ends[1][body], first, size) for body in ends[0]
        ):
            yield Finding(
                "same-loop",
                f"closure '{second.name}'",
                f"is the same as closure '{first.name}': the same kind, between the same two bodies, in the "
                "same place",
                "it adds nothing, and wrenches in the two are not unique",
                "remove one of them, or correct the links and frames of the one that was copied",
                *subject.first_place([second.name]),
            )


def _sides(closure: Closure) -> list[tuple[str, Array]]:
    return [(closure.link_a, closure.frame_a), (closure.link_b, closure.frame_b)]


def _same(first: Array, second: Array, closure: Closure, size: float) -> bool:
    """Check whether two ends of closures of one kind hold a body in the same way."""
    apart = inverse(first) @ second
    if closure.rotation != "free" and not _parallel(apart[:3, 2], np.array([0.0, 0.0, 1.0])):
        return False
    held = apart[list(closure.translations), 3]
    return bool(np.abs(held).max(initial=0.0) < SAME_END * max(size, np.finfo(float).tiny))
