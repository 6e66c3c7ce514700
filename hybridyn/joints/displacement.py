"""Move a joint by a displacement, and find the displacement between two postures.

With q = moved(q_0, xi), `difference(q_0, q)` is xi, and xi_dot = pull(xi, v) for rates v of the joint. Shift
and turn move separately, which is a retraction and not Pinocchio's exponential. Functions take numbers or
symbols, with coordinates last, after any batch axes; symbols of quaternions are of unit length.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..spatial import (
    Array,
    along,
    arctan2,
    cos,
    cross,
    hat,
    length,
    multiplied,
    rotate,
    rotate_back,
    rotation_from_quaternion,
    sin,
    vector_from_quaternion,
)
from .kinds import JointKind, Turn

#: Below this rotation [rad] the inverse of its right Jacobian is a series, exact to rounding.
SMALL_ANGLE = 1e-4


def placed(kind: JointKind, q: Array, axis: Array, slope: float) -> tuple[Array, Array]:
    """Compute rotations and shifts of the child of a joint, in its own axes, (..., 3, 3) and (..., 3).

    Args:
        q: Positions, shape (..., nq).
        axis: Unit axis, shape (3,); of a joint with several freedoms the third one.
        slope: Way along the axis per unit of the one position.
    """
    n = kind.shift
    still = np.zeros((*q.shape[:-1], 3 - n))
    shift = (
        multiplied(q[..., :1], slope * axis) if kind.single else np.concatenate([q[..., :n], still], axis=-1)
    )
    if kind.ball:
        return rotation_from_quaternion(q[..., n:]), shift
    if kind.slides:
        return np.broadcast_to(np.eye(3), (*q.shape[:-1], 3, 3)), shift
    turn = np.concatenate([cos(q), sin(q)], axis=-1) if kind.additive else q[..., n:]
    turn = np.concatenate([np.ones_like(turn[..., :1]), turn], axis=-1)
    return rotate(turn_parts(axis).reshape(3, 9).T, turn).reshape(*q.shape[:-1], 3, 3), shift


def turn_parts(axis: Array) -> Array:
    """Return C0, C1, C2 of rotations about axes (..., 3), C0 + C1 cos + C2 sin, shape (..., 3, 3, 3)."""
    along = axis[..., :, None] * axis[..., None, :]
    return np.stack([along, np.eye(3) - along, hat(axis)], axis=-3)


def moved(kind: JointKind, q: Array, xi: Array) -> Array:
    """Compute the position after a displacement, shapes (..., nq) and (..., nv); it stays on the manifold."""
    if kind.additive:
        return q + xi
    n = kind.shift
    turn = _turned if kind.turn is Turn.CIRCLE else _followed
    end = turn(q[..., n:], xi[..., n:])
    return np.concatenate([q[..., :n] + _carried(kind, q[..., n:], xi[..., :n]), end], axis=-1) if n else end


def difference(kind: JointKind, q: Array, other: Array) -> Array:
    """Compute the displacement from one position to another, shape (..., nv)."""
    return _difference(kind, q, other, _ball_vector)


def chord(kind: JointKind, q: Array, other: Array) -> Array:
    """Compute `difference`, where a rotation in space is twice the sine of half its angle, shape (..., nv).

    It is less than the angle by a tenth of its cube, and free of logarithms.
    """
    return _difference(kind, q, other, _ball_chord)


def rate(kind: JointKind, q: Array, v: Array) -> Array:
    """Compute the time derivative of the coordinates from the rates, shape (..., nq)."""
    if kind.additive:
        return v
    n, w = kind.shift, v[..., kind.shift :]
    if kind.turn is Turn.CIRCLE:
        turning = np.concatenate([-q[..., n + 1 :] * w, q[..., n : n + 1] * w], axis=-1)
    else:
        x, s = q[..., n : n + 3], q[..., n + 3 :]
        turning = 0.5 * np.concatenate([s * w + cross(x, w), -along(x, w)], axis=-1)
    return np.concatenate([_carried(kind, q[..., n:], v[..., :n]), turning], axis=-1) if n else turning


def pull(kind: JointKind, xi: Array, v: Array) -> Array:
    """Compute xi_dot = T(xi)^-1 v, the rate of a displacement, shape (..., nv).

    T is the identity for one freedom, and the right Jacobian of SO(3) for rotations in space.
    """
    if kind.single:
        return v
    n, r, w = kind.shift, xi[..., kind.shift :], v[..., kind.shift :]
    if kind.turn is Turn.CIRCLE:
        turn, turning = np.concatenate([cos(r), sin(r)], axis=-1), w
    else:
        turn, turning = _half_turn(r), _vector_rate(r, w)
    return np.concatenate([_carried(kind, turn, v[..., :n]), turning], axis=-1) if n else turning


def bending(kind: JointKind, v: Array) -> Array:
    """Compute xi_ddot of constant rates at xi = 0, shape (T, nv): shifts turn with the child's axes."""
    out, n = np.zeros_like(v), kind.shift
    if n == 3:
        out[:, :n] = cross(v[:, n:], v[:, :n])
    elif n == 2:
        out[:, :n] = v[:, n:] * np.stack([-v[:, 1], v[:, 0]], axis=1)
    return out


def push(kind: JointKind, xi: Array, xi_dot: Array) -> Array:
    """Compute v = T(xi) xi_dot from numbers, shapes (nv,) and (nv,) or (nv, k).

    T itself cancels at small angles, its inverse does not.
    """
    return np.asarray(np.linalg.solve(pull(kind, xi, np.eye(kind.nv)).T, xi_dot))


def unwound(kind: JointKind, xi: Array, near: Array) -> Array:
    """Add the whole turns to a displacement that bring it nearest to another, numbers of shape (nv,)."""
    out, turn = xi.copy(), slice(kind.shift, None)
    if kind.turn is Turn.CIRCLE:
        out[turn] += 2 * np.pi * np.round((near[turn] - xi[turn]) / (2 * np.pi))
    angle = float(np.linalg.norm(xi[turn]))
    if kind.turn is Turn.BALL and angle > 0:
        further = float(near[turn] @ xi[turn]) / angle - angle
        out[turn] += xi[turn] / angle * (2 * np.pi * np.round(further / (2 * np.pi)))
    return out


def centred(kind: JointKind, xi: Array) -> Array:
    """Express a displacement in coordinates about its midpoint, numbers of shape (nv,)."""
    n, half = kind.shift, xi[kind.shift :] / 2
    if n < 2:
        return xi
    turn = _half_turn(half) if kind.turn is Turn.BALL else np.concatenate([cos(half), sin(half)])
    return np.concatenate([_carried(kind, turn, xi[:n], back=True), xi[n:]])


def _difference(kind: JointKind, q: Array, other: Array, ball: Callable[[Array, Array], Array]) -> Array:
    if kind.additive:
        return other - q
    n = kind.shift
    here, there = q[..., n:], other[..., n:]
    turn = (_angle if kind.turn is Turn.CIRCLE else ball)(here, there)
    shift = _carried(kind, here, other[..., :n] - q[..., :n], back=True)
    return np.concatenate([shift, turn], axis=-1) if n else turn


def _carried(kind: JointKind, turn: Array, x: Array, *, back: bool = False) -> Array:
    """Turn a shift from the child's axes into the joint's, or back."""
    if kind.shift == 3:
        return (rotate_back if back else rotate)(rotation_from_quaternion(turn), x)
    if kind.shift == 2:
        c, s = turn[..., :1], -turn[..., 1:] if back else turn[..., 1:]
        return np.concatenate([c * x[..., :1] - s * x[..., 1:], s * x[..., :1] + c * x[..., 1:]], axis=-1)
    return x


def _turned(circle: Array, angle: Array) -> Array:
    """Turn a unit vector in the plane, shapes (..., 2) and (..., 1)."""
    c, s, x, y = cos(angle), sin(angle), circle[..., :1], circle[..., 1:]
    return _unit(np.concatenate([x * c - y * s, x * s + y * c], axis=-1))


def _followed(quaternion: Array, turn: Array) -> Array:
    """Multiply a quaternion by the rotation of a rotation vector in the body's frame."""
    half = _half_turn(turn)
    u, c, x, w = half[..., :3], half[..., 3:], quaternion[..., :3], quaternion[..., 3:]
    return _unit(np.concatenate([w * u + c * x + cross(x, u), w * c - along(x, u)], axis=-1))


def _half_turn(r: Array) -> Array:
    """Return the unit quaternion x, y, z, w of a rotation vector."""
    half = 0.5 * r
    angle = length(half)
    return np.concatenate([sin(angle) / angle * half, cos(angle)], axis=-1)


def _vector_rate(r: Array, w: Array) -> Array:
    """Compute the rate of a rotation vector from the angular velocity in the body's frame."""
    once = cross(r, w)
    out: Array = w + 0.5 * once + _second(r) * cross(r, once)
    return out


def _second(r: Array) -> Any:
    """Compute (1 - x cot x) / |r|^2 with x = |r| / 2."""
    angle = length(r)
    x = 0.5 * angle
    whole = (1.0 - x * cos(x) / sin(x)) / (angle * angle)
    # Where this is rounding, r x (r x w) is smaller still; numbers take the series.
    return whole if r.dtype == object else np.where(angle < SMALL_ANGLE, 1.0 / 12.0, whole)


def _angle(x: Array, y: Array) -> Array:
    """Compute the signed angle from one unit vector in the plane to another, shape (..., 1)."""
    sine = x[..., :1] * y[..., 1:] - x[..., 1:] * y[..., :1]
    out: Array = arctan2(sine, x[..., :1] * y[..., :1] + x[..., 1:] * y[..., 1:])
    return out


def _ball_vector(x: Array, y: Array) -> Array:
    """Compute the rotation vector from one quaternion to another."""
    return vector_from_quaternion(np.concatenate([0.5 * _ball_chord(x, y), along(x, y)], axis=-1))


def _ball_chord(x: Array, y: Array) -> Array:
    """Compute twice the sine of half the rotation from one quaternion to another, along its axis."""
    turn = x[..., 3:] * y[..., :3] - y[..., 3:] * x[..., :3] - cross(x[..., :3], y[..., :3])
    return 2.0 * turn


def _unit(x: Array) -> Array:
    return 1.0 / length(x) * x
