"""Rows of directions and distances in expressions, as `linkage.pointing` has them."""

from __future__ import annotations

from typing import Any, NamedTuple

from ....linkage import pointing
from ....spatial import along, cross, rotate
from ....symbols import Expression


class PointingRows(NamedTuple):
    """Rows of a direction or a distance.

    Attributes:
        residual: Actual minus prescribed, shape (rows,), [rad or m].
        map: From the angular velocity of the link, or from the velocity of its origin, to the rates of the
            residual where what is prescribed rests, shape (rows, 3); axes of the frame of the target.
        asked: Prescribed rates of the rows, shape (rows,): those of a link that goes with what is prescribed.
        cosine: Cosine of the angle from a prescribed direction; 1 for distances.
    """

    residual: Expression
    map: Expression
    asked: Expression
    cosine: Any


def direction_rows(R: Expression, axis: int, wanted: Expression, rate: Expression) -> PointingRows:
    """Write the rows of the direction of a link's axis.

    Args:
        R: Axes of the link, shape (3, 3).
        axis: Number of the axis.
        wanted: The prescribed direction, shape (3,).
        rate: Its time derivative, shape (3,).
    """
    residual, over = pointing.direction_rows(R, axis, wanted)
    asked = rotate(pointing.met_direction_rows(R, axis), cross(wanted, rate))
    return PointingRows(residual, over, asked, along(R[:, axis], wanted)[0])


def distance_rows(p: Expression, wanted: Expression, rate: Expression) -> PointingRows:
    """Write the row of a link's distance from a point.

    Args:
        p: The link's origin, shape (3,).
        wanted: The prescribed distance and the point, shape (4,).
        rate: Their time derivatives, shape (4,).
    """
    distance, n = pointing.away(p - wanted[1:])
    return PointingRows(distance - wanted[:1], n[None], rate[:1] + along(n, rate[1:]), 1.0)
