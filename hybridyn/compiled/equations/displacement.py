"""Displacements and differences of joints in expressions: `hybridyn.linkage.joints` and `.retraction`.

With q = move(q_0, xi) the rates v satisfy xi_dot = T(xi)^-1 v.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np

from ...linkage.tree import Tree
from .expressions import Expression, along, cross, dot
from .rigid import quaternion_matrix

JointMap = Callable[..., Expression]

#: Added to squared lengths to avoid 0 / 0; it changes no bit for any angle that matters.
TINY_ANGLE = 1e-300


def by_joint(tree: Tree, function: JointMap, *values: Expression, positions: int = 0) -> Expression:
    """Apply a function of one joint to the values of a whole tree, joint by joint.

    Args:
        function: Takes a joint's kind and its slice of each value.
        values: Arrays over the tree: first those over coordinates, then those over freedoms.
        positions: Number of arrays over coordinates.
    """
    parts = [
        function(joint.kind, *(x[at] for x in values[:positions]), *(x[to] for x in values[positions:]))
        for joint, at, to in zip(tree.joints, tree.q_slices, tree.v_slices, strict=True)
    ]
    return np.concatenate([np.zeros(0, dtype=object), *parts])


def moved_joint(kind: str, q: Expression, xi: Expression) -> Expression:
    """Compute a joint's position after a displacement, like `joints.TreeJoint.integrate`."""
    if kind in ("revolute", "prismatic"):
        return q + xi
    if kind == "continuous":
        return _turned(q, xi[0])
    if kind == "spherical":
        return _followed(q, xi)
    if kind == "planar":
        c, s = q[2], q[3]
        shift = np.array([q[0] + c * xi[0] - s * xi[1], q[1] + s * xi[0] + c * xi[1]], dtype=object)
        return np.concatenate([shift, _turned(q[2:], xi[2])])
    return np.concatenate([q[:3] + dot(quaternion_matrix(q[3:]), xi[:3]), _followed(q[3:], xi[3:])])


def position_rate(kind: str, q: Expression, v: Expression) -> Expression:
    """Compute the time derivative of a joint's position coordinates from its rates."""
    if kind in ("revolute", "prismatic"):
        return v
    if kind == "continuous":
        return np.array([-q[1] * v[0], q[0] * v[0]], dtype=object)
    if kind == "planar":
        c, s = q[2], q[3]
        return np.array([c * v[0] - s * v[1], s * v[0] + c * v[1], -s * v[2], c * v[2]], dtype=object)
    x, w, turning = q[-4:-1], q[-1], v[-3:]
    vector = _scaled(w, turning) + cross(x, turning)
    turned = _scaled(0.5, np.array([*vector, -along(x, turning)], dtype=object))
    if kind == "spherical":
        return turned
    return np.concatenate([dot(quaternion_matrix(q[3:]), v[:3]), turned])


def displacement_rate(kind: str, xi: Expression, v: Expression) -> Expression:
    """Compute T(xi)^-1 v, like `retraction.Retraction.pull`."""
    if kind in ("revolute", "prismatic", "continuous"):
        return v
    if kind == "planar":
        c, s = ca.cos(xi[2]), ca.sin(xi[2])
        return np.array([c * v[0] - s * v[1], s * v[0] + c * v[1], v[2]], dtype=object)
    r, w = xi[-3:], v[-3:]
    once = cross(r, w)
    turning = w + _scaled(0.5, once) + _scaled(_second(r), cross(r, once))
    if kind == "spherical":
        return turning
    return np.concatenate([dot(quaternion_matrix(_half_turn(r)), v[:3]), turning])


def _turned(cos_sin: Expression, angle: Any) -> Expression:
    """Rotate a unit vector in the plane by an angle."""
    c, s = ca.cos(angle), ca.sin(angle)
    x, y = cos_sin
    return _unit(np.array([x * c - y * s, x * s + y * c], dtype=object))


def _followed(quaternion: Expression, turn: Expression) -> Expression:
    """Multiply a quaternion by the rotation of a rotation vector in the body frame."""
    half = _half_turn(turn)
    u, c, x, w = half[:3], half[3], quaternion[:3], quaternion[3]
    vector = _scaled(w, u) + _scaled(c, x) + cross(x, u)
    return _unit(np.array([*vector, w * c - along(x, u)], dtype=object))


def _half_turn(r: Expression) -> Expression:
    """Return the unit quaternion (x, y, z, w) of a rotation vector."""
    half = _scaled(0.5, r)
    angle = _length(half)
    return np.array([*_scaled(ca.sin(angle) / angle, half), ca.cos(angle)], dtype=object)


def _second(r: Expression) -> Any:
    """Compute (1 - x cot x) / |r|^2 with x = |r| / 2; if it is rounding, r x (r x w) is smaller still."""
    angle = _length(r)
    x = 0.5 * angle
    return (1.0 - x * ca.cos(x) / ca.sin(x)) / (angle * angle)


def _length(x: Expression) -> Any:
    return ca.sqrt(sum((x[i] * x[i] for i in range(len(x))), ca.SX(TINY_ANGLE)))


def _unit(x: Expression) -> Expression:
    return _scaled(1.0 / _length(x), x)


def _scaled(factor: Any, x: Expression) -> Expression:
    return np.array([factor * entry for entry in x], dtype=object)


def joint_difference(kind: str, q: Expression, other: Expression) -> Expression:
    """Compute the twist from one position of a joint to another, like `joints.TreeJoint.difference`.

    Rotations in space are twice the sine of half their angle: less than it by a tenth of its cube.
    """
    if kind in ("revolute", "prismatic"):
        return other - q
    if kind == "continuous":
        return np.array([_angle_between(q, other)], dtype=object)
    if kind == "planar":
        d, c, s = other[:2] - q[:2], q[2], q[3]
        return np.array(
            [c * d[0] + s * d[1], c * d[1] - s * d[0], _angle_between(q[2:], other[2:])], dtype=object
        )
    x, w, y, u = q[-4:-1], q[-1], other[-4:-1], other[-1]
    side = cross(x, y)
    turn = np.array([2.0 * (w * y[i] - u * x[i] - side[i]) for i in range(3)], dtype=object)
    if kind == "spherical":
        return turn
    return np.concatenate([dot(quaternion_matrix(q[3:]).T, other[:3] - q[:3]), turn])


def _angle_between(x: Expression, y: Expression) -> Any:
    """Compute the signed angle from one unit vector to another."""
    return ca.atan2(x[0] * y[1] - x[1] * y[0], x[0] * y[0] + x[1] * y[1])
