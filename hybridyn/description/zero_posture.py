"""Compute the placements of all links where every joint is at zero."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from .records import Array, Joint


def poses_at_zero(joints: Iterable[Joint]) -> dict[str, Array]:
    """Compute the frame of every link in the frame of its root, all joints at zero.

    The joints need not form a tree yet: links of a cycle are left out, and a link with two parents takes the
    first.

    Returns:
        Placements by link name, each of shape (4, 4).
    """
    every = list(joints)
    children = {joint.child for joint in every}
    out = {joint.parent: np.eye(4) for joint in every if joint.parent not in children}
    for joint in outwards(every, list(out)):
        out.setdefault(joint.child, out[joint.parent] @ joint.placement)
    return out


def outwards(joints: Iterable[Joint], roots: list[str]) -> Iterator[Joint]:
    """Yield the joints from the roots outwards, each after the joint that carries it."""
    below: dict[str, list[Joint]] = {}
    for joint in joints:
        below.setdefault(joint.parent, []).append(joint)
    waiting = list(roots)
    while waiting:
        for joint in below.pop(waiting.pop(), ()):
            yield joint
            waiting.append(joint.child)


def relative(pose_a: Array, pose_b: Array) -> Array:
    """Compute the placement of frame B in frame A from both poses, shape (4, 4)."""
    out = np.eye(4)
    rotation = pose_a[:3, :3].T
    out[:3, :3], out[:3, 3] = rotation @ pose_b[:3, :3], rotation @ (pose_b[:3, 3] - pose_a[:3, 3])
    return out
