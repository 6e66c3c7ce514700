"""Joints one behind the other between two links: how readers add them to a robot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from ..joints.kinds import JointKind
from ..spatial import quaternion_from_rotation
from .records import Array, Joint, RobotFile, massless

#: The axis of a joint that has none.
NO_AXIS = np.array([1.0, 0.0, 0.0])


def step(name: str, kind: JointKind, axis: Array | None = None, /, **numbers: Any) -> Joint:
    """Return a joint of a chain, without links.

    Args:
        name: Its name.
        kind: Its kind.
        axis: Unit vector, shape (3,), where it has one.
        numbers: Limits, friction and rotor, as in `records.Joint`.
    """
    return Joint(name, kind, "", "", np.eye(4), NO_AXIS if axis is None else axis, **numbers)


def add_chain(robot: RobotFile, chain: Sequence[Joint], links: Sequence[str]) -> None:
    """Add joints one behind the other to a robot, and the massless links between them.

    Args:
        robot: The robot.
        chain: The joints, without links.
        links: Names of the links that they join; the first and the last are not added.
    """
    between = zip(links[1:-1], chain, strict=False)
    robot.links += [massless(name, joint.line, between=True) for name, joint in between]
    pairs = zip(chain, pairwise(links), strict=True)
    robot.joints += [replace(joint, parent=above, child=below) for joint, (above, below) in pairs]


def pose_coordinates(frame: Array) -> tuple[float, ...]:
    """Return x, y, z [m] and the quaternion x, y, z, w of a placement (4, 4), shape (7,)."""
    return tuple(float(x) for x in (*frame[:3, 3], *quaternion_from_rotation(frame[:3, :3])))
