"""Check the axes of hinges in loops, and loops that are stated twice.

About a loop the rotations of its joints make up none. If all its hinges but one are parallel, that one turns
by the part of the rotation that is not about their axis, which is none: it can never turn. Such a hinge is
the sign of an axis that was forgotten or written in another frame, as of a plane mechanism one of whose axes
is not the normal of the plane.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ...description.loop_signs import Bodies
from ...description.names import counted, listed
from ...description.placement import inverse, poses_at, rotation_to_axis, turned
from ...description.records import Closure, Description, Joint
from ...errors import HybridynError
from ...spatial import Array
from ...structure.building import rebuilt
from .finding import Finding
from .subject import Subject

#: Axes are parallel if the sine of their angle is below this; files keep four digits and more.
SAME_AXIS = 1e-3
#: Fewest hinges of a loop that must be parallel for another one to be called wrong.
FEWEST = 2
#: Ends of two closures are in the same place if they differ by less than this part of the robot's size.
SAME_END = 1e-6


class _Hinge(NamedTuple):
    """A hinge of a loop.

    Attributes:
        of: Its joint or closure.
        axis: Its axis at home in the root link, shape (3,).
    """

    of: Joint | Closure
    axis: Array


def check_axes(subject: Subject) -> Iterator[Finding]:
    """Find hinges that can never turn, since all others of their loop are parallel; each hinge once."""
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


def _hinges(subject: Subject, closure: Closure, poses: dict[str, Array]) -> tuple[list[_Hinge], list[Array]]:
    """Return the hinges of a closure's loop and the directions of its slides.

    There are none where the loop also turns otherwise. A closure that slides and turns is no hinge of which
    one may say that it should turn.
    """
    out, slides = list[_Hinge](), list[Array]()
    for joint in _loop(subject, closure):
        axis = poses[joint.child][:3, :3] @ joint.axis
        if joint.kind in ("revolute", "continuous"):
            out.append(_Hinge(joint, axis))
        elif joint.kind == "prismatic":
            slides.append(axis)
        elif joint.kind != "fixed":
            return [], []
    if closure.rotation == "parallel" and closure.translations == (0, 1, 2):
        out.append(_Hinge(closure, (poses[closure.link_a] @ closure.frame_a)[:3, 2]))
    elif closure.rotation != "fixed":
        return [], []
    return out, slides


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
    (one, own), normal = across, others[0].axis
    angle = float(np.degrees(np.arccos(min(1.0, abs(float(own @ normal))))))
    frame = poses[one.child] if isinstance(one, Joint) else poses[one.link_a] @ one.frame_a
    wanted = (frame[:3, :3] if isinstance(one, Joint) else frame[:3, :3] @ one.turn.T).T @ normal
    numbers = " ".join(f"{x:.6g}" for x in np.round(wanted, 9) + 0.0)
    texts = (
        f"it can never turn: its axis is at {angle:.3g} degrees to those of {_listed(others)}, the other "
        f"hinges of its loop, which are parallel{_freedoms(subject, one, normal, poses)}",
        "the loop has fewer freedoms than its hinges allow, and may close nowhere or be locked",
        f"if it should turn like them, state its axis in its own frame: {numbers}; an axis that is left out "
        f"is {'x' if subject.description.format == 'URDF' else 'the default of the format'}",
    )
    if isinstance(one, Joint):
        return subject.of_joint("axis-across", one.name, *texts)
    return Finding("axis-across", f"closure '{one.name}'", *texts, *subject.first_place([one.name]))


def _listed(hinges: list[_Hinge]) -> str:
    return listed(hinge.of.name for hinge in hinges)


def _freedoms(subject: Subject, one: Joint | Closure, normal: Array, poses: dict[str, Array]) -> str:
    """Say how many freedoms the robot would have with a hinge's axis along a normal."""
    robot = subject.robot
    if robot is None:
        return ""
    try:
        would = rebuilt(robot, _with_axis(subject.description, one, normal, poses)).mobility
    except HybridynError:
        return ""
    if would == robot.mobility:
        return ""
    motors, freedoms = counted(len(robot.motors), "motor"), counted(would, "freedom")
    return f"; if it were, too, the robot would have {freedoms}, not {robot.mobility} ({motors})"


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
    bodies, size = Bodies(subject.description), subject.extent
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
