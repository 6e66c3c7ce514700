"""Find wrists: chains of massless passive joints that are equivalent to one closure.

Three kinds of chains constrain two bodies exactly as one closure does: a single joint, two revolute joints
whose axes intersect at a right angle (universal), and three revolute joints whose axes intersect in one point
(spherical). If they are cut, a leg keeps only the joints that move mass. The positions of the cut joints
follow from the bodies that the wrist connects.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from ..description.records import RotationKind
from ..linkage.closures import TreeClosure
from ..spatial import Array
from .bodies import Bodies

#: Axes of a wrist must intersect to this part of the robot's reach, and the cosine between the axes of a
#: universal joint must be below this. Otherwise a cut would change the mechanism.
EXACT = 1e-13

_REVOLUTE = ("revolute", "continuous")


@dataclass(frozen=True, eq=False)
class Wrist:
    """A chain of joints that is replaced by one closure.

    Attributes:
        joints: Numbers of the joints, from `parent` outwards.
        kind: "spherical", "universal", or the kind of a single joint.
        parent: Body to which the first joint of the chain is attached.
        end: Body at the end of the chain.
        target: Body to which `end` is fixed: `end` itself if the chain carries a platform, another body if a
            weld closes the loop.
        R: Axes of `end` in `target`, shape (3, 3).
        p: Origin of `end` in `target`, shape (3,), [m].
        closure: Name of the weld that fixes `end`, or None if the chain carries a platform.
    """

    joints: tuple[int, ...]
    kind: str
    parent: int
    end: int
    target: int
    R: Array = field(default_factory=lambda: np.eye(3))
    p: Array = field(default_factory=lambda: np.zeros(3))
    closure: str | None = None


def find_wrist(
    bodies: Bodies,
    joints: list[int],
    closures: list[TreeClosure],
    carried: list[int],
    held: set[int],
    end: int,
) -> Wrist | None:
    """Find the longest chain of joints above a body that one closure can replace.

    Args:
        bodies: The robot's bodies.
        joints: Numbers of the module's joints.
        closures: The module's closures.
        carried: Bodies that carry other modules.
        held: Joints that must not be cut: motors, coupled joints and the joints held by `build_robot`.
        end: Body at the end of the chain.

    Returns:
        The wrist, or None if there is none.
    """
    chain: list[int] = []
    body = end
    best = None
    while len(chain) < 3 and body - 1 in joints:
        joint = bodies.joints[body - 1]
        record = joint.joint
        acts = record.damping or record.friction or record.rotor_inertia
        if body - 1 in held or acts or record.kind == "floating":
            break
        chain.insert(0, body - 1)
        kind = _kind(bodies, chain)
        if kind:
            best = Wrist(tuple(chain), kind, joint.parent, end, end)
        body = joint.parent
        neighbours = sum(bodies.joints[i].parent == body for i in joints)
        closed = any(body in (c.body_a, c.body_b) for c in closures)
        if not bodies.bodies[body].massless or neighbours > 1 or closed or body in carried:
            break
    return best


def _kind(bodies: Bodies, chain: list[int]) -> str | None:
    """Return the kind of closure that is equivalent to a chain of joints, or None."""
    kinds = [bodies.joints[i].joint.kind for i in chain]
    if len(chain) == 1:
        return str(kinds[0])
    if any(kind not in _REVOLUTE for kind in kinds):
        return None
    centres = [_crossing(bodies, i, j) for i, j in pairwise(chain)]
    if any(c is None for c in centres):
        return None
    if len(chain) == 2:
        first, second = (bodies.joints[i] for i in chain)
        return "universal" if abs(first.joint.axis @ second.R @ second.joint.axis) < EXACT else None
    # Both intersections must be the same point of the second axis, expressed in the second joint's child.
    second = bodies.joints[chain[1]]
    before, after = centres
    assert before is not None
    assert after is not None
    apart = second.R.T @ (before - second.p) - after
    return "spherical" if apart @ apart <= (EXACT * bodies.reach) ** 2 else None


def _crossing(bodies: Bodies, first: int, second: int) -> Array | None:
    """Compute the point where two adjacent revolute axes intersect, in the body between them, or None."""
    a, joint = bodies.joints[first].joint.axis, bodies.joints[second]
    b, p = joint.R @ joint.joint.axis, joint.p
    normal = np.cross(a, b)
    if normal @ normal < 1e-6:
        return None  # nearly parallel axes do not form a wrist
    if abs(normal @ p) > EXACT * bodies.reach * np.linalg.norm(normal.astype(float)):
        return None
    along = np.cross(p, b) @ normal / (normal @ normal)
    return along * a


def wrist_closure(bodies: Bodies, wrist: Wrist) -> TreeClosure:
    """Build the closure between a wrist's parent and its target that is equivalent to the wrist."""
    first, last = bodies.joints[wrist.joints[0]], bodies.joints[wrist.joints[-1]]
    c_first, c_last = np.zeros(3), np.zeros(3)
    if len(wrist.joints) > 1:
        crossing = _crossing(bodies, wrist.joints[0], wrist.joints[1])
        assert crossing is not None
        c_first = crossing
        below = _crossing(bodies, wrist.joints[-2], wrist.joints[-1])
        assert below is not None
        c_last = last.R.T @ (below - last.p)
    turn_a, turn_b = axis_frame(first.joint.axis), axis_frame(last.joint.axis)
    shapes: dict[str, tuple[tuple[int, ...], RotationKind]] = {
        "spherical": ((0, 1, 2), "free"),
        "universal": ((0, 1, 2), "perpendicular"),
        "revolute": ((0, 1, 2), "parallel"),
        "continuous": ((0, 1, 2), "parallel"),
        "prismatic": ((0, 1), "fixed"),
        "planar": ((2,), "parallel"),
    }
    translations, rotation = shapes[wrist.kind]
    if wrist.kind in ("spherical", "planar"):
        turn_a = turn_b = np.eye(3)
    return TreeClosure(
        wrist.closure or first.joint.name, wrist.kind,
        wrist.parent, first.R @ turn_a, first.p + first.R @ c_first,
        wrist.target, wrist.R @ turn_b, wrist.p + wrist.R @ c_last,
        translations, rotation,
    )  # fmt: skip


def axis_frame(axis: Array) -> Array:
    """Return orthonormal axes, shape (3, 3), whose third axis is `axis`."""
    other = np.zeros(3)
    other[np.argmin(np.abs(axis))] = 1.0
    x = np.cross(other, axis)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(axis, x), axis], axis=1)
