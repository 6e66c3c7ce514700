"""Rods: bodies between a closure's point and a joint that lets them turn about the line between."""

from __future__ import annotations

from collections.abc import Container, Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from ...joints.kinds import JointKind
from ...linkage.closures import TreeClosure
from ...spatial import Array
from ...structure.wrists import axis_frame
from .expressions import snap
from .rigid import Links, freedoms

#: A closure does not feel a motion that opens it by less than this, without units: rounding. The idle
#: motion of a leg moves its mass by less, too.
UNFELT = 1e-13


@dataclass(frozen=True, eq=False)
class Rod:
    """The side of a closure on a rod that turns about a point, in whose axes the closure's rows are sparse.

    Rows in other axes have no pivot that is large at every posture: the rod's turns move its end sideways.

    Attributes:
        on_a: Whether the rod is the closure's predecessor.
        axes: Axes of the rows in the rod's body, the third along the rod, shape (3, 3).
        turns: Freedoms of the joints about the point; they do not move the rod's end along the rod.
    """

    on_a: bool
    axes: Array
    turns: tuple[int, ...]


def rods_of(links: Links, closures: Sequence[TreeClosure], platforms: Container[int] = ()) -> dict[int, Rod]:
    """Return the rods of closures by the closure's number; of one tree, in plain numbers.

    Args:
        platforms: Joints of floating bodies that are no rods: further legs hold them.
    """
    out: dict[int, Rod] = {}
    for k, c in enumerate(closures):
        if not is_ball(c):
            continue
        sides = [
            Rod(on_a, *found)
            for on_a, body, point in ((True, c.body_a, c.p_a), (False, c.body_b, c.p_b))
            if body - 1 not in platforms
            and (found := _free_rod(links, closures, k, body, point) or _rod(links, body, point))
        ]
        if sides:  # a ball before a universal joint: a platform on a wrist is no rod that turns
            out[k] = max(sides, key=lambda rod: len(rod.turns))
    return out


def loosened(rods: dict[int, Rod], links: Links, closures: Sequence[TreeClosure]) -> dict[int, Rod]:
    """Return rods without turns where arguments may move what is on the line off it.

    Args:
        rods: Rods by the closure's number.
        links: Links of the tree, whose numbers may be arguments.
        closures: The closures.
    """
    out = {}
    for k, rod in rods.items():
        body, moves = closures[k].body_a if rod.on_a else closures[k].body_b, False
        while body and links[body - 1].kind.slides:
            link = links[body - 1]
            moves, body = moves or _moved(link.R) or _moved(link.p), link.parent
        moves = moves or bool(body and links[body - 1].kind.hinge and _moved(links[body - 1].p))
        out[k] = replace(rod, turns=()) if moves else rod
    return out


def _moved(numbers: Array) -> bool:
    """Return whether a number of a frame is an argument."""
    return any(isinstance(x, ca.SX) for x in np.ravel(numbers))


def is_ball(closure: TreeClosure) -> bool:
    """Return whether a closure holds a point, and no axes."""
    return closure.translations == (0, 1, 2) and closure.rotation == "free"


def _free_rod(
    links: Links, closures: Sequence[TreeClosure], number: int, body: int, point: Array
) -> tuple[Array, tuple[int, ...]] | None:
    """Return `_rod` of a body on a floating joint that a ball and another one hold, and nothing else."""
    if (
        not body
        or links[body - 1].kind is not JointKind.FLOATING
        or any(link.parent == body for link in links.values())
    ):
        return None
    others = [c for k, c in enumerate(closures) if k != number and body in (c.body_a, c.body_b)]
    if len(others) != 1 or not is_ball(others[0]):
        return None
    line = point - (others[0].p_a if others[0].body_a == body else others[0].p_b)
    length, first = float(np.linalg.norm(line)), freedoms(links)[body - 1].start
    if not length:
        return None
    beside = np.abs(np.cross(point, line)).max() > UNFELT * length
    turns = () if beside else tuple(range(first + 3, first + 6))
    return snap(axis_frame(snap(line / length))), turns


def _rod(links: Links, body: int, point: Array) -> tuple[Array, tuple[int, ...]] | None:
    """Return the axes and the turning freedoms of the rod that ends at a point of a body, or None.

    A rod is a body on a ball or a universal joint, or slides along its line on one.
    """
    line, turn = [point], np.eye(3)
    while body and links[body - 1].kind.slides:
        link = links[body - 1]
        turn = turn @ link.R.T
        line += [turn @ link.R @ link.axis, turn @ link.p]
        body = links[body - 1].parent
    joints = [body - 1] if body else []
    if joints and links[body - 1].kind.hinge and np.abs(links[body - 1].p).max() <= UNFELT:
        joints.append(links[body - 1].parent - 1)
    kinds = [links[i].kind for i in joints if i >= 0]
    if kinds != [JointKind.SPHERICAL] and not (len(kinds) == 2 and all(kind.hinge for kind in kinds)):
        return None
    lengths = np.linalg.norm(line, axis=1)
    axis = line[int(np.argmax(lengths))] / (lengths.max() or 1.0)
    if not lengths.max() or np.abs(np.cross(line, axis)).max() > UNFELT * max(lengths.max(), 1.0):
        return None
    at = freedoms(links)
    turns = [col for i in joints for col in range(at[i].start, at[i].stop)]
    return snap(axis_frame(snap(axis))), tuple(turns)
