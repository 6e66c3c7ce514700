"""Turn numbers, rotations and inertias into what files state; it reads back as the same, or to rounding."""

from __future__ import annotations

from collections.abc import Iterable
from math import atan2, cos, hypot, sin

import numpy as np

from ..description.records import Array


def numeral(value: float) -> str:
    """Return the shortest text that reads back as the same number; whole numbers have no point."""
    text = repr(float(value) + 0.0)  # -0.0 becomes 0.0
    return text.removesuffix(".0")


def numerals(values: Iterable[float]) -> str:
    """Return numbers with spaces between them."""
    return " ".join(numeral(value) for value in values)


def angles_of(rotation: Array) -> tuple[float, float, float]:
    """Compute roll, pitch and yaw [rad], the inverse of `placement.rotation_from_rpy`.

    Roll is computed with yaw already taken away, so that the product is right to rounding near pitch = 90
    degrees, too.

    Args:
        rotation: Rotation matrix, shape (3, 3).
    """
    r = [[float(x) for x in row] for row in rotation]
    yaw = atan2(r[1][0], r[0][0])
    s, c = sin(yaw), cos(yaw)
    pitch = atan2(-r[2][0], hypot(r[0][0], r[1][0]))
    roll = atan2(s * r[0][2] - c * r[1][2], c * r[1][1] - s * r[0][1])
    return roll, pitch, yaw


def quaternion_of(rotation: Array) -> Array:
    """Compute the unit quaternion x, y, z, w of a rotation matrix, shape (4,), with w >= 0.

    The largest component is computed first, so that none is divided by a small number.

    Args:
        rotation: Rotation matrix, shape (3, 3).
    """
    r = rotation
    trace = float(np.trace(r))
    squares = np.array([*(1 + 2 * np.diag(r) - trace), 1 + trace])  # 4 x^2, 4 y^2, 4 z^2, 4 w^2
    products = np.array(
        [
            [squares[0], r[0, 1] + r[1, 0], r[0, 2] + r[2, 0], r[2, 1] - r[1, 2]],
            [r[0, 1] + r[1, 0], squares[1], r[1, 2] + r[2, 1], r[0, 2] - r[2, 0]],
            [r[0, 2] + r[2, 0], r[1, 2] + r[2, 1], squares[2], r[1, 0] - r[0, 1]],
            [r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1], squares[3]],
        ]
    )
    q: Array = products[int(np.argmax(squares))]
    q = q / np.linalg.norm(q)
    return -q if q[3] < 0 else q


def principal(inertia: Array) -> tuple[Array, Array]:
    """Return the principal moments of an inertia, shape (3,), and their axes as columns, shape (3, 3)."""
    if not np.any(inertia - np.diag(np.diag(inertia))):
        return np.diag(inertia).copy(), np.eye(3)
    moments, axes = np.linalg.eigh(inertia)
    return moments, -axes if np.linalg.det(axes) < 0 else axes
