"""One joint of a tree: the placement of its child, integration and difference.

Arrays have the samples first: positions (T, nq), twists (T, nv) of this joint alone.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from ..joints.displacement import bending, difference, moved, placed
from ..joints.kinds import JointKind
from ..spatial import Array

#: Name of the free-flyer joint of the root link, as in Pinocchio.
ROOT_JOINT = "root_joint"


@dataclass(frozen=True, eq=False)
class TreeJoint:
    """A joint of a tree; the child of joint i is body i + 1 (body 0 is the base).

    Attributes:
        kind: Kind of joint (never "fixed").
        parent: Index of the parent body.
        R: Child axes at joint position zero, shape (3, 3), parent frame.
        p: Child origin at joint position zero, shape (3,), [m], parent frame.
        axis: Unit axis, shape (3,), child frame.
        pitch: Way of a screw along its axis [m/rad]; 0 for the other kinds.
    """

    name: str
    kind: JointKind
    parent: int = 0
    R: Array = field(default_factory=lambda: np.eye(3))
    p: Array = field(default_factory=lambda: np.zeros(3))
    axis: Array = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    pitch: float = 0.0

    def on(self, parent: int) -> TreeJoint:
        """Return the joint on a body of this number."""
        return self if parent == self.parent else replace(self, parent=parent)

    @property
    def slope(self) -> float:
        """Way along the axis per unit of the one position."""
        return 1.0 if self.kind.slides else self.pitch

    @cached_property
    def S(self) -> Array:
        """Motion subspace, shape (6, nv), child frame; constant for every kind of joint."""
        if self.kind.single:
            return np.concatenate([self.slope * self.axis, (not self.kind.slides) * self.axis])[:, None]
        return np.eye(6)[:, self.kind.columns]

    def transform(self, q: Array) -> tuple[Array, Array]:
        """Compute how the joint turns and shifts its child: rotations (..., 3, 3), shifts (..., 3).

        Positions of shape (..., nq) are numbers or symbols. The tree evaluates all joints with one freedom
        together (`Tree.sweep`).
        """
        axis = self.axis if self.kind.single else np.array([0.0, 0.0, 1.0])
        return placed(self.kind, q, axis, self.slope)

    @property
    def neutral(self) -> Array:
        """The zero position, shape (nq,)."""
        return np.array(self.kind.zero)

    def integrate(self, q: Array, dq: Array) -> Array:
        """Integrate the constant twist dq from q over unit time, shape (T, nq)."""
        return moved(self.kind, q, dq)

    def bending(self, v: Array) -> Array:
        """Compute the second time derivative of the displacement of constant rates, shape (T, nv)."""
        return bending(self.kind, v)

    def difference(self, q0: Array, q1: Array) -> Array:
        """Compute the twist dq with `integrate(q0, dq) = q1`, shape (T, nv)."""
        return difference(self.kind, q0, q1)
