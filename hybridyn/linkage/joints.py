"""One joint of a tree: its coordinates, the placement of its child, integration and difference.

Arrays have the samples first: positions (T, nq), twists (T, nv) of this joint alone.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ..description.records import ZERO, JointKind
from ..spatial import (
    Array,
    cross,
    hat,
    rotate,
    rotate_back,
    rotation_from_axis_angle,
    rotation_from_quaternion,
    rotation_vector,
)

#: Name of the free-flyer joint of the root link, as in Pinocchio.
ROOT_JOINT = "root_joint"
#: Number of coordinates of each kind of joint.
NQ = {kind: len(q) for kind, q in ZERO.items()}
#: Number of leading coordinates in metres, for the kinds of joint that have any.
TRANSLATIONS = {"prismatic": 1, "planar": 2, "floating": 3}
#: Number of freedoms of each kind of joint.
NV = {"revolute": 1, "continuous": 1, "prismatic": 1, "spherical": 3, "planar": 3, "floating": 6}
#: Letter of each kind of joint, used to write chains of joints: R R P.
LETTERS = {
    "revolute": "R", "continuous": "R", "prismatic": "P", "spherical": "S", "planar": "E", "floating": "F",
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class TreeJoint:
    """A joint of a tree; the child of joint i is body i + 1 (body 0 is the base).

    Attributes:
        kind: Kind of joint (never "fixed").
        parent: Index of the parent body.
        R: Child axes at joint position zero, shape (3, 3), parent frame.
        p: Child origin at joint position zero, shape (3,), [m], parent frame.
        axis: Unit axis, shape (3,), child frame.
    """

    name: str
    kind: JointKind
    parent: int = 0
    R: Array = field(default_factory=lambda: np.eye(3))
    p: Array = field(default_factory=lambda: np.zeros(3))
    axis: Array = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))

    @cached_property
    def S(self) -> Array:
        """Motion subspace, shape (6, nv), child frame; constant for every kind of joint."""
        if self.kind == "prismatic":
            return np.concatenate([self.axis, np.zeros(3)])[:, None]
        if self.kind in ("revolute", "continuous"):
            return np.concatenate([np.zeros(3), self.axis])[:, None]
        columns = {"spherical": (3, 4, 5), "planar": (0, 1, 5), "floating": range(6)}[self.kind]
        return np.eye(6)[:, list(columns)]

    def transform(self, q: Array) -> tuple[Array, Array]:
        """Compute the child placement of a joint with several freedoms: rotations (T, 3, 3), shifts (T, 3).

        The tree evaluates all joints with one freedom together (`Tree.sweep`).
        """
        zero = np.zeros((len(q), 3))
        if self.kind == "spherical":
            return rotation_from_quaternion(q), zero
        if self.kind == "planar":
            zero[:, :2] = q[:, :2]
            return rotation_from_axis_angle(np.array([0.0, 0.0, 1.0]), q[:, 2], q[:, 3]), zero
        return rotation_from_quaternion(q[:, 3:]), q[:, :3]

    @property
    def turn_parts(self) -> Array:
        """C0, C1, C2 of the child axes in the parent, C0 + C1 cos + C2 sin, shape (3, 3, 3)."""
        along = np.outer(self.axis, self.axis)
        parts: Array = np.matmul(self.R, np.array([along, np.eye(3) - along, hat(self.axis)]))
        return parts

    @property
    def neutral(self) -> Array:
        """The zero position, shape (nq,)."""
        return np.array(ZERO[self.kind])

    def integrate(self, q: Array, dq: Array) -> Array:
        """Integrate the constant twist dq from q over unit time, shape (T, nq).

        The result stays on the joint's manifold. For `floating` and `planar` joints rotation and translation
        are integrated separately, which is a retraction and not Pinocchio's exponential.
        """
        if self.kind in ("revolute", "prismatic"):
            return q + dq
        if self.kind == "continuous":
            return _turn(q, dq[:, 0])
        if self.kind == "spherical":
            return _compose(q, dq)
        out = np.empty_like(q)
        if self.kind == "planar":
            cos, sin = q[:, 2], q[:, 3]
            out[:, 0] = q[:, 0] + cos * dq[:, 0] - sin * dq[:, 1]
            out[:, 1] = q[:, 1] + sin * dq[:, 0] + cos * dq[:, 1]
            out[:, 2:] = _turn(q[:, 2:], dq[:, 2])
        else:
            out[:, :3] = q[:, :3] + rotate(rotation_from_quaternion(q[:, 3:]), dq[:, :3])
            out[:, 3:] = _compose(q[:, 3:], dq[:, 3:])
        return out

    def difference(self, q0: Array, q1: Array) -> Array:
        """Compute the twist dq with `integrate(q0, dq) = q1`, shape (T, nv)."""
        if self.kind in ("revolute", "prismatic"):
            return q1 - q0
        out = np.empty((len(q0), NV[self.kind]))
        if self.kind == "continuous":
            out[:, 0] = _turned(q0, q1)
        elif self.kind == "planar":
            d, cos, sin = q1[:, :2] - q0[:, :2], q0[:, 2], q0[:, 3]
            out[:, 0] = cos * d[:, 0] + sin * d[:, 1]
            out[:, 1] = cos * d[:, 1] - sin * d[:, 0]
            out[:, 2] = _turned(q0[:, 2:], q1[:, 2:])
        else:
            R = rotation_from_quaternion(q0[:, -4:])
            turn = np.matmul(np.swapaxes(R, 1, 2), rotation_from_quaternion(q1[:, -4:]))
            out[:, -3:] = rotation_vector(turn)
            if self.kind == "floating":
                out[:, :3] = rotate_back(R, q1[:, :3] - q0[:, :3])
        return out


def _turned(x: Array, y: Array) -> Array:
    """Compute the signed angles from unit vectors x to y, shape (T,)."""
    return np.arctan2(x[:, 0] * y[:, 1] - x[:, 1] * y[:, 0], x[:, 0] * y[:, 0] + x[:, 1] * y[:, 1])


def _turn(cos_sin: Array, angle: Array) -> Array:
    """Rotate unit vectors (T, 2) by angles (T,)."""
    cos, sin = np.cos(angle), np.sin(angle)
    out = np.stack([cos_sin[:, 0] * cos - cos_sin[:, 1] * sin, cos_sin[:, 0] * sin + cos_sin[:, 1] * cos], -1)
    unit: Array = out / np.linalg.norm(out, axis=-1, keepdims=True)
    return unit


def _compose(quat: Array, turn: Array) -> Array:
    """Multiply quaternions (T, 4) by the exp of rotation vectors (T, 3), body frame."""
    half = 0.5 * np.linalg.norm(turn, axis=-1, keepdims=True)
    u = 0.5 * turn * np.sinc(half / np.pi)
    c = np.cos(half)
    x, w = quat[:, :3], quat[:, 3:]
    out = np.concatenate(
        [w * u + c * x + cross(x, u), w * c - np.sum(x * u, axis=-1, keepdims=True)], axis=-1
    )
    unit: Array = out / np.linalg.norm(out, axis=-1, keepdims=True)
    return unit
