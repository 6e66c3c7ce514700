"""Links of a tree as numbers: aligned axes and base inertial parameters.

Neither changes a force or a motion of the joints. Both make more numbers zero.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...linkage.joints import NV, TreeJoint
from ...spatial import Array
from ...structure.wrists import axis_frame
from .expressions import ROTATION_ROUNDING, numbers, plain, settled, snap
from .rigid import moved

TURNING = ("revolute", "continuous")


@dataclass(frozen=True, eq=False)
class Link:
    """One joint and its child body as numbers.

    Attributes:
        kind: Kind of joint.
        parent: Index of the parent body in the tree (0: the base; the child of link i is body i + 1).
        R: Child axes in the parent at joint position zero, shape (3, 3).
        p: Child origin in the parent at joint position zero, shape (3,), [m].
        axis: Joint axis in the child, shape (3,).
        inertia: Ten numbers of the child's inertia (`rigid`), shape (10,).
    """

    kind: str
    parent: int
    R: Array
    p: Array
    axis: Array
    inertia: Array

    @property
    def nv(self) -> int:
        """Number of freedoms."""
        return NV[self.kind]


def links_of(joints: tuple[TreeJoint, ...], inertias: list[Array]) -> list[Link]:
    """Return the links of a tree from its joints and its bodies' ten numbers."""
    return [
        Link(j.kind, j.parent, snap(j.R), j.p, j.axis, inertia)
        for j, inertia in zip(joints, inertias, strict=True)
    ]


def aligned(links: list[Link], fixed: frozenset[int]) -> tuple[list[Link], list[Array]]:
    """Turn bodies' frames so that the axis of every joint of one freedom is a coordinate axis.

    Args:
        fixed: Bodies whose frames must not change.

    Returns:
        The links, and for each body (base first) the new axes in the old axes, shape (3, 3).
    """
    turns = [
        axis_frame(link.axis)
        if body not in fixed and np.abs(link.axis).max() < 1.0 and link.nv == 1
        else None
        for body, link in enumerate(links, 1)
    ]
    return _turned(links, turns)


def _turned(links: list[Link], turns: list[Array | None]) -> tuple[list[Link], list[Array]]:
    """Turn the frame of each body that has a turn."""
    axes = [np.eye(3), *(np.eye(3) if turn is None else turn for turn in turns)]
    out = []
    for link, turn, here in zip(links, turns, axes[1:], strict=True):
        back = axes[link.parent].T
        inertia = np.array(moved(plain(link.inertia), plain(here.T), plain(np.zeros(3))), dtype=float)
        axis = link.axis if turn is None else snap(turn.T @ link.axis)
        out.append(replace(link, R=snap(back @ link.R @ here), p=back @ link.p, axis=axis, inertia=inertia))
    return out, axes


def regrouped(links: list[Link]) -> tuple[list[Link], Array]:
    """Move inertial parameters that do not affect a joint's force to the parent body, outermost first.

    The force of a revolute joint does not depend on the mass, the first moment along the axis, and an inertia
    (y, y, 0) about it. That of a prismatic joint does not depend on the inertia about the child's origin, and
    that of a spherical joint not on the mass.

    Returns:
        The links, and the ten numbers that are moved to the base, shape (10,).

    Source:
        Reference [34] of Ibrahim & Khalil (2010): base inertial parameters.
    """
    out = list(links)
    base = np.zeros(10)
    for i in reversed(range(len(out))):
        link = out[i]
        gone = unfelt(link)
        out[i] = replace(link, inertia=_clean(link.inertia - gone, link.inertia))
        at = settled(moved(numbers(gone), numbers(link.R), numbers(link.p)))
        if link.parent:
            parent = out[link.parent - 1]
            out[link.parent - 1] = replace(parent, inertia=parent.inertia + at)
        else:
            base = base + at
    return out, base


def _clean(inertia: Array, before: Array) -> Array:
    """Set entries of ten numbers to zero that are rounding of the previous ones; expressions stay."""
    if inertia.dtype == object:
        return settled(inertia)
    out = inertia.copy()
    for part in (slice(1, 4), slice(4, 10)):
        size = np.abs(before[part]).max()
        out[part] = np.where(np.abs(out[part]) < ROTATION_ROUNDING * size, 0.0, out[part])
    return out


def unfelt(link: Link) -> Array:
    """Return the part of a link's ten numbers that does not affect its joint's force, shape (10,)."""
    gone = np.zeros(10, dtype=link.inertia.dtype)
    if link.kind in TURNING and np.abs(link.axis).max() == 1.0:
        k = int(np.argmax(np.abs(link.axis)))
        diagonal = (4, 7, 9)
        gone[0], gone[1 + k] = link.inertia[0], link.inertia[1 + k]
        first, second = (diagonal[i] for i in range(3) if i != k)
        gone[first] = gone[second] = link.inertia[second]
    elif link.kind == "prismatic":
        gone[4:] = link.inertia[4:]
    elif link.kind == "spherical":
        gone[0] = link.inertia[0]
    return gone


def units_of(link: Link, length: float) -> Array:
    """Return the unit of each freedom of a joint: `length` for translations, 1 (a radian) for rotations."""
    sliding = {"prismatic": 1, "planar": 2, "floating": 3}.get(link.kind, 0)
    return np.array([length] * sliding + [1.0] * (link.nv - sliding))
