"""Gearboxes as SDF states them: couplings between the angles of two links against a third one."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from ..joints.kinds import Turn
from .closure_forms import LARGEST_COSINE
from .placement import poses_at_zero
from .records import Array, Coupling, Joint, RobotFile


class Gearbox(NamedTuple):
    """A gearbox: angle of the second link = -ratio x angle of the first one, both against the reference.

    Attributes:
        name: Its name.
        ends: The two links.
        axes: Unit vectors about which the angles are, each in the frame of its link, shapes (3,).
        reference: The link against which they turn.
        ratio: As above.
        line: Line in the file, or None.
    """

    name: str
    ends: tuple[str, str]
    axes: tuple[Array, Array]
    reference: str
    ratio: float
    line: int | None


def coupling_of(box: Gearbox, robot: RobotFile) -> Coupling:
    """Return the coupling of a gearbox, of joints of the tree.

    Raises:
        ValueError: No sum of joint positions is such an angle, or nothing is coupled.
    """
    above = {joint.child: joint for joint in robot.joints}
    poses = poses_at_zero(robot.joints)
    terms: dict[str, float] = {}
    for end, axis, factor in zip(box.ends, box.axes, (box.ratio, 1.0), strict=True):
        about = poses[end][:3, :3] @ axis
        for joint, toward in _way(box.reference, end, above):
            terms[joint.name] = terms.get(joint.name, 0.0) + factor * toward * _sense(joint, about, poses)
    kept = tuple((name, factor) for name, factor in reversed(terms.items()) if factor)
    if not kept:
        raise ValueError("couples nothing; check its links, its reference body and its ratio")
    return Coupling(box.name, kept, 0.0, box.line)


def _way(start: str, end: str, above: Mapping[str, Joint]) -> Iterator[tuple[Joint, float]]:
    """Yield the joints from one link to another: 1 for those that lead outwards, -1 for those inwards."""
    up, down = _path(start, above), _path(end, above)
    while up and down and up[-1] is down[-1]:
        up.pop()
        down.pop()
    yield from ((joint, -1.0) for joint in up)
    yield from ((joint, 1.0) for joint in down)


def _path(link: str, above: Mapping[str, Joint]) -> list[Joint]:
    """Return the joints from a link up to its root."""
    out = []
    while link in above:
        out.append(above[link])
        link = out[-1].parent
    return out


def _sense(joint: Joint, about: Array, poses: Mapping[str, Array]) -> float:
    """Return the turn about an axis of the root's frame per position of a joint: 1, -1, or 0 for slides.

    Raises:
        ValueError: The joint turns otherwise.
    """
    if joint.kind.turn is Turn.NONE:
        return 0.0
    axis = poses[joint.child][:3, :3] @ joint.axis
    if not joint.kind.single or np.linalg.norm(np.cross(axis, about)) > LARGEST_COSINE:
        raise ValueError(
            f"joint '{joint.name}' is between the reference body and a link of the gearbox and does not turn "
            "about its axis; no sum of joint positions is the angle that the gearbox ties"
        )
    return float(np.sign(axis @ about))
