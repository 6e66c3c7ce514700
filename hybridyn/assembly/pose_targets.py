"""The rows that a pose adds to those of the trees in which it is measured."""

from __future__ import annotations

import numpy as np

from ..linkage.motion import Motion
from ..linkage.pointing import DirectionTarget, DistanceTarget
from ..linkage.targets import COORDINATES, CoordinateTarget, PoseTarget, Target
from ..spatial import Array
from .poses import PoseRequest

#: Axes and origin of a frame in another, shapes (3, 3) and (3,).
Placement = tuple[Array, Array]


def whole_target(body: int, motion: Motion, length: float) -> PoseTarget:
    """Return the rows of a body's whole pose; `length` is the unit of its lengths [m]."""
    return PoseTarget(body, motion, _units(length))


def partial_targets(
    pose: PoseRequest, body: int, frame: Placement, link: Placement, length: float
) -> list[Target]:
    """Return the rows of what a pose prescribes, its whole motion apart.

    Args:
        pose: The pose.
        body: Number of the link's body.
        frame: The frame in which the pose is measured, in the base of the tree.
        link: The link in its body.
        length: Unit of lengths [m].
    """
    out: list[Target] = []
    names, units, (R, p) = (pose.link, pose.reference), _units(length), frame
    if pose.turn is not None:
        frame_at, back = (Motion.at_rest(len(pose.turn.p), axes) for axes in (R, link[0].T))
        out.append(PoseTarget(body, frame_at.then(pose.turn).then(back), units[3:]))
    if some := tuple(pose.coordinates):
        value, rate, acceleration = (np.stack([pose.coordinates[n][i] for n in some], 1) for i in range(3))
        own = units[[COORDINATES.index(name) for name in some]]
        out.append(CoordinateTarget(body, names, some, R, p, link, value, rate, acceleration, own))
    if pose.direction is not None:
        axis, (value, rate, acceleration) = pose.direction
        out.append(DirectionTarget(body, axis, R, link[0], value, rate, acceleration, units[3:5]))
    if pose.distance is not None:
        out.append(DistanceTarget(body, R, p, link[1], *pose.distance, units[:1]))
    return out


def _units(length: float) -> Array:
    """Return the units of a pose's six rows: a length, and a radian."""
    return np.array([length] * 3 + [1.0] * 3)
