"""Closures that MuJoCo has no word for: a body of its own follows one link and is welded to the other.

The follower hangs on the first link by the joints that the closure leaves free, and has half of the other
link's inertia. Together they are the same rigid body, so that the motion stays the same; a body of small
mass would be a soft weld.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...description.closure_forms import SIDEWAYS
from ...description.placement import inverse, placement_from
from ...description.poses import turn_about
from ...description.records import Array, Closure, Link
from ..numerals import quaternion_of
from ..request import Losses
from .inertias import Inertias

Z = np.array([0.0, 0.0, 1.0])
#: End of the name of a follower, after the closure's name.
FOLLOWER = "follower"


@dataclass(frozen=True, eq=False)
class Axis:
    """A joint of a follower: its kind in MuJoCo, axis in the follower's frame (3,), position at home."""

    kind: str
    axis: Array
    home: tuple[float, ...]

    def motion(self) -> Array:
        """Return the motion from position zero to the reference position, shape (4, 4); a ball has none."""
        if self.kind == "slide":
            return placement_from(np.eye(3), self.home[0] * self.axis)
        if self.kind == "hinge":
            return placement_from(turn_about(self.axis, self.home[0]), np.zeros(3))
        return np.eye(4)


@dataclass(frozen=True, eq=False)
class Follower:
    """A body that hangs on one link of a closure and is welded to the other.

    Attributes:
        on: Name of the link that it hangs on.
        frame: Its frame in that link at joint positions zero, shape (4, 4).
        body: Its inertia, in its frame.
        first: Whether it hangs on the closure's first link.
    """

    name: str
    on: str
    frame: Array
    joints: tuple[Axis, ...]
    body: Link
    first: bool


def follower_of(
    closure: Closure, inertias: Inertias, poses: dict[str, Array], still: set[str], losses: Losses
) -> Follower:
    """Return the follower of a closure, and take its inertia from a link.

    Args:
        closure: The closure.
        inertias: Inertias of the robot; those of a link are halved.
        poses: Pose of each link in the home posture, shapes (4, 4).
        still: Names of the links that do not move.
        losses: Receives a follower whose mass is added.
    """
    solid = [inertias.is_solid(link) and link not in still for link in (closure.link_a, closure.link_b)]
    first = solid[1] or not solid[0]
    on, welded = (closure.link_a, closure.link_b) if first else (closure.link_b, closure.link_a)
    frame = closure.frame_b if first else closure.frame_a
    if any(solid) or welded in still:
        body = inertias.share(welded, frame) if any(solid) else inertias.light
    else:
        losses.add("closures between links without mass: a body of small mass follows them", closure.name)
        body = inertias.light
    A = poses[closure.link_a] @ closure.frame_a
    B = poses[closure.link_b] @ closure.frame_b
    place, joints = (_from_a if first else _from_b)(closure, inverse(A) @ B)
    own = closure.frame_a if first else closure.frame_b
    return Follower(closure.name, on, own @ place, joints, body, first)


def _from_a(closure: Closure, X: Array) -> tuple[Array, tuple[Axis, ...]]:
    """Return the place of B at zero in A, and the joints from A to B; X is B in A at home."""
    place, turns = _turns(closure, X[:3, :3])
    slides = [
        Axis("slide", place[:3, :3].T @ np.eye(3)[i], (float(X[i, 3]),))
        for i in range(3)
        if i not in closure.translations
    ]
    return place, (*slides, *turns)


def _from_b(closure: Closure, X: Array) -> tuple[Array, tuple[Axis, ...]]:
    """Return the place of A at zero in B, and the joints from B to A: those from A to B in reverse."""
    place, turns = _turns(closure, X[:3, :3])
    turn = place[:3, :3]
    back = [
        Axis(
            t.kind,
            turn @ t.axis,
            (-t.home[0],) if t.kind == "hinge" else (*(-x for x in t.home[:3]), t.home[3]),
        )
        for t in reversed(turns)
    ]
    slides = [
        Axis("slide", np.eye(3)[i], (-float(X[i, 3]),)) for i in range(3) if i not in closure.translations
    ]
    return inverse(place), (*back, *slides)


def _turns(closure: Closure, R: Array) -> tuple[Array, list[Axis]]:
    """Return the place of B at zero in A, and the turning joints from A to B; R are B's axes in A at home."""
    if closure.rotation == "fixed":
        return np.eye(4), []
    if closure.rotation == "parallel":
        return np.eye(4), [Axis("hinge", Z, (float(np.arctan2(R[1, 0], R[0, 0])),))]
    if closure.rotation == "free":
        w, x, y, z = quaternion_of(R)
        return np.eye(4), [Axis("ball", Z, (x, y, z, w))]
    alpha = float(np.arctan2(R[1, 2], R[0, 2]))
    c, s = np.cos(alpha), np.sin(alpha)
    rest = SIDEWAYS.T @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) @ R
    beta = float(np.arctan2(rest[1, 0], rest[0, 0]))
    return placement_from(SIDEWAYS, np.zeros(3)), [
        Axis("hinge", SIDEWAYS.T @ Z, (alpha,)),
        Axis("hinge", Z, (beta,)),
    ]
