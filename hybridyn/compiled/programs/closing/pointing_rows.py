"""Rows of directions and distances in expressions, as `linkage.pointing` has them."""

from __future__ import annotations

from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from ....linkage.pointing import SMALL_SINE
from ....spatial import cross, hat
from ....symbols import Expression, dot, plus, times
from ...equations.expressions import along, filled, plain

#: Added to squared lengths to avoid 0 / 0.
NO_LENGTH = 1e-300


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
    e, others = plain(np.eye(3)[axis]), [(axis + 1) % 3, (axis + 2) % 3]
    d = dot(R.T, wanted)
    turn, cosine, moved = cross(d, e), d[axis], hat(d)
    sine = length_of(turn)
    angle, safe = ca.atan2(sine, cosine), ca.fmax(sine, SMALL_SINE)
    straight = ca.logic_and(sine < SMALL_SINE, cosine > 0.0)
    factor = ca.if_else(straight, 1.0 + sine * sine / 6.0, angle / sine)
    slope = ca.if_else(straight, -1.0 / 3.0, -(safe - angle * cosine) / (safe * safe * safe))
    rows = plus(_times(factor, dot(-hat(e), moved)), _times(slope, dot(turn[:, None], moved[None, axis])))
    asked = dot(R.T, cross(wanted, rate))
    return PointingRows(_times(factor, turn)[others], dot(rows[others], R.T), asked[others], cosine)


def met_direction_rows(R: Expression, axis: int) -> Expression:
    """Write the map of `direction_rows` where the axis has the direction, and goes with it."""
    return R.T[[(axis + 1) % 3, (axis + 2) % 3]]


def distance_rows(p: Expression, wanted: Expression, rate: Expression) -> PointingRows:
    """Write the row of a link's distance from a point.

    Args:
        p: The link's origin, shape (3,).
        wanted: The prescribed distance and the point, shape (4,).
        rate: Their time derivatives, shape (4,).
    """
    way = p - wanted[1:]
    distance = length_of(way)
    n = _times(1.0 / distance, way)
    miss, asked = distance - wanted[0], plus(rate[0], along(n, rate[1:]))
    return PointingRows(filled([miss], 1), n[None], filled([asked], 1), 1.0)


def length_of(x: Expression) -> ca.SX:
    """Compute the length of a vector, not quite zero."""
    return ca.sqrt(sum((y * y for y in x), ca.SX(NO_LENGTH)))


def _times(factor: Any, values: Expression) -> Expression:
    """Multiply an array by a scalar."""
    return filled([times(factor, x) for x in values.ravel()], *values.shape)
