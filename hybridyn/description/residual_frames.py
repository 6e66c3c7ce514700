"""Frames in closures that other packages state by a residual: where links are, by the joints between them.

The placement of one link in another is written on the positions of the joints between the two, on symbols
once. So a residual of frames is one of joint positions, and all else follows from `residuals`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import takewhile
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..joints.displacement import placed
from ..joints.kinds import JointKind
from ..spatial import Array, compose, rotate, rotate_back

if TYPE_CHECKING:
    from .records import Joint


class FramePlacement(NamedTuple):
    """Where a link is in another one, on symbols.

    Attributes:
        R: Its axes, shape (3, 3).
        p: Its origin [m], shape (3,).
    """

    R: Array
    p: Array


def joints_between(joints: Iterable[Joint], first: str, other: str) -> tuple[list[Joint], list[Joint]]:
    """Return the joints from the nearest link that carries two links outwards to each of them.

    Args:
        joints: The joints of a robot; they need not make a tree yet.
    """
    above = {joint.child: joint for joint in joints}
    ways: list[list[Joint]] = []
    for link in (first, other):
        way: list[Joint] = []
        while link in above and len(way) < len(above):
            way.insert(0, above[link])
            link = above[link].parent
        ways.append(way)
    shared = len([*takewhile(lambda pair: pair[0] is pair[1], zip(*ways, strict=False))])
    return ways[0][shared:], ways[1][shared:]


def joints_of_frames(joints: Sequence[Joint], frames: Sequence[str]) -> dict[str, Joint]:
    """Return the joints by name that lie between the first of some links and the others, fixed ones, too."""
    ways = (joints_between(joints, frames[0], other) for other in frames[1:])
    return {joint.name: joint for pair in ways for way in pair for joint in way}


def placement_of(
    joints: Sequence[Joint], first: str, other: str, positions: Mapping[str, Any]
) -> FramePlacement:
    """Compute where a link is in another one.

    Args:
        joints: The joints of the robot.
        first: The link in which it is.
        other: The link.
        positions: Position of each joint between them that moves: an expression.
    """
    (A, a), (B, b) = (_outermost(way, positions) for way in joints_between(joints, first, other))
    return FramePlacement(compose(A.T, B), rotate_back(A, b - a))


def _outermost(way: Sequence[Joint], positions: Mapping[str, Any]) -> tuple[Array, Array]:
    """Return axes and origin of the last link of a chain of joints, in the link before the chain."""
    R, p = np.eye(3), np.zeros(3)
    for joint in way:
        R, p = compose(R, joint.placement[:3, :3]), p + rotate(R, joint.placement[:3, 3])
        if joint.kind != "fixed":
            kind = JointKind.REVOLUTE if joint.kind.endless else joint.kind
            x = np.empty(1, dtype=object)
            x[0] = positions[joint.name]
            turn, shift = placed(kind, x, joint.axis, 1.0 if kind.slides else joint.pitch)
            R, p = compose(R, turn), p + rotate(R, shift)
    return R, p
