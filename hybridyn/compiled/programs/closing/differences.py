"""Differences of joint positions in expressions: `hybridyn.linkage.joints`, joint by joint."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from ...equations.expressions import Expression, cross, dot
from ...equations.rigid import quaternion_matrix


def joint_difference(kind: str, q: Expression, other: Expression) -> Expression:
    """Compute the twist from one position of a joint to another, like `joints.TreeJoint.difference`.

    Rotations in space are twice the sine of half their angle: less than it by a tenth of its cube.
    """
    if kind in ("revolute", "prismatic"):
        return other - q
    if kind == "continuous":
        return np.array([_turned(q, other)], dtype=object)
    if kind == "planar":
        d, c, s = other[:2] - q[:2], q[2], q[3]
        return np.array([c * d[0] + s * d[1], c * d[1] - s * d[0], _turned(q[2:], other[2:])], dtype=object)
    x, w, y, u = q[-4:-1], q[-1], other[-4:-1], other[-1]
    side = cross(x, y)
    turn = np.array([2.0 * (w * y[i] - u * x[i] - side[i]) for i in range(3)], dtype=object)
    if kind == "spherical":
        return turn
    return np.concatenate([dot(quaternion_matrix(q[3:]).T, other[:3] - q[:3]), turn])


def _turned(x: Expression, y: Expression) -> Any:
    """Compute the signed angle from one unit vector to another."""
    return ca.atan2(x[0] * y[1] - x[1] * y[0], x[0] * y[0] + x[1] * y[1])
