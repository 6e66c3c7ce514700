"""Say a closure with the constraints that engines have: coinciding points and welds."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from ....description.placement import placement_from
from ....description.records import Closure
from ....spatial import Array

#: Distance of the two points that stand for a hinge from its centre, relative to the robot's size.
HINGE = 0.1


class Joining(NamedTuple):
    """A constraint between two links.

    Attributes:
        kind: "point": the origins of the frames coincide. "weld": the frames coincide.
        frame_a: Frame on the closure's first link, shape (4, 4).
        frame_b: Frame on its second link, shape (4, 4).
    """

    kind: Literal["point", "weld"]
    frame_a: Array
    frame_b: Array


def joinings(closure: Closure, size: float) -> list[Joining]:
    """Return the points or the weld that state a closure; none if they cannot.

    A hinge is two points on its axis: six rows, of which five are independent.

    Args:
        size: Size of the robot [m].
    """
    if closure.translations != (0, 1, 2) or closure.rotation == "perpendicular":
        return []
    if closure.rotation == "fixed":
        return [Joining("weld", closure.frame_a, closure.frame_b)]
    out = []
    for shift in (0.0,) if closure.rotation == "free" else (-HINGE * size, HINGE * size):
        way = placement_from(np.eye(3), np.array([0.0, 0.0, shift]))
        out.append(Joining("point", closure.frame_a @ way, closure.frame_b @ way))
    return out
