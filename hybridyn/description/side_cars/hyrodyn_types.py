"""Close the loops of HyRoDyn's mechanisms by the name of their type.

The names state how the legs end; where they end follows from the tree. A leg is moved by a slide. The origin
of the slide's child link is the point where the leg meets another link, at the place where it stands with all
joints at zero:

    rrPr       one leg behind a hinge meets the link that the independent joint moves, by a hinge
    2SPU+1U    two legs meet the link behind the independent joints, by balls; likewise 6UPS
    2SPRR+1U   two legs meet links that hinges carry behind the independent joints, by universal joints:
               the slide stays perpendicular to the arm of its hinge

Source: HyRoDyn, the constructors of its submechanisms.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ..closure_forms import FORMS, LARGEST_COSINE, Form, closure_of
from ..joint_words import BALL, HINGE, UNIVERSAL
from ..placement import relative, rotation_to_axis
from ..records import Array, Closure, Joint

#: How many legs the mechanisms have, and by which closure a leg ends.
LEGS = {
    "rrPr": (1, HINGE), "2SPU+1U": (2, BALL), "6UPS": (6, BALL), "2SPRR+1U": (2, UNIVERSAL),
}  # fmt: skip


class Legs(NamedTuple):
    """A mechanism of HyRoDyn.

    Attributes:
        type: Its type, a key of `LEGS`.
        spanning: Names of its joints.
        independent: Names of the joints that carry the link at which the legs end.
        active: Names of the slides of the legs.
    """

    type: str
    spanning: Sequence[str]
    independent: Sequence[str]
    active: Sequence[str]


def closures_of(legs: Legs, joints: list[Joint], poses: Mapping[str, Array], line: int) -> list[Closure]:
    """Return the closures of a mechanism.

    Args:
        legs: The mechanism, of joints of the robot.
        joints: The joints of the robot.
        poses: Pose of each link where all joints are at zero, shapes (4, 4).
        line: Line in the side-car.

    Raises:
        ValueError: Its joints are not those of its type.
    """
    count, kind = LEGS[legs.type]
    named, above = {joint.name: joint for joint in joints}, {joint.child: joint for joint in joints}
    slides = [named[name] for name in legs.active]
    if len(slides) != count or any(not joint.kind.slides for joint in slides):
        raise ValueError(f"has the slides of its legs as active joints, {count} of them")
    if not legs.independent:
        raise ValueError("needs jointnames_independent")
    end = max((named[name].child for name in legs.independent), key=lambda link: len([*_path(link, above)]))
    partners = [end] * count
    if kind == UNIVERSAL:
        arms = [
            named[name] for name in legs.spanning if _body(named[name].parent, above) == _body(end, above)
        ]
        if len(arms) != count or any(not arm.kind.hinge for arm in arms):
            raise ValueError(f"has a hinge for each leg behind its independent joints, {count} of them")
        partners = [arm.child for arm in arms]
    return [
        _closure(slide, partner, kind, above, poses, line)
        for slide, partner in zip(slides, partners, strict=True)
    ]


def _closure(
    slide: Joint, partner: str, kind: str, above: Mapping[str, Joint], poses: Mapping[str, Array], line: int
) -> Closure:
    """Return the closure between a leg and the link at which it ends.

    A leg that ends in a hinge moves in a plane. Only the rows in this plane close it, so that axes which are
    not quite parallel do not lock it.

    Raises:
        ValueError: No hinge is above the slide.
    """
    tip, form, turns = poses[slide.child], FORMS[BALL], [np.eye(3)] * 2
    if kind == HINGE:
        hinge = next((joint for joint in _path(slide.parent, above) if joint.kind.hinge), None)
        if hinge is None:
            raise ValueError(f"has a hinge above the slide '{slide.name}'")
        axis = tip[:3, :3].T @ poses[hinge.child][:3, :3] @ hinge.axis
        form, turns = Form((0, 1), "free"), [rotation_to_axis(axis)] * 2
    elif kind == UNIVERSAL:
        hinge = above[partner]
        across = np.cross(tip[:3, :3].T @ poses[partner][:3, :3] @ hinge.axis, slide.axis)
        if np.linalg.norm(across) < LARGEST_COSINE:
            raise ValueError(f"has slides across its hinges; '{slide.name}' is along '{hinge.name}'")
        form = FORMS[kind]
        turns = [rotation_to_axis(axis) for axis in (slide.axis, across / np.linalg.norm(across))]
    sides = (slide.child, np.eye(4)), (partner, relative(poses[partner], tip))
    return closure_of(slide.name, "rows" if kind == HINGE else kind, sides, turns, form, line)


def _path(link: str, above: Mapping[str, Joint]) -> Iterator[Joint]:
    """Yield the joints from a link up to the root."""
    while link in above:
        yield above[link]
        link = above[link].parent


def _body(link: str, above: Mapping[str, Joint]) -> str:
    """Return the first of the links to which fixed joints weld a link."""
    while link in above and above[link].kind == "fixed":
        link = above[link].parent
    return link
