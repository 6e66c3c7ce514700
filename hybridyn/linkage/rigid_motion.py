"""Motion of a frame relative to another for a batch: placement, velocities, accelerations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..spatial import Array, cross, rotate, rotate_back
from .tree import Motion


@dataclass(frozen=True, eq=False)
class RigidMotion:
    """Motion of a frame in a reference frame; all vectors in the axes of the reference.

    Attributes:
        R: Axes, shape (T, 3, 3).
        p: Origin, shape (T, 3), [m].
        w: Angular velocity, shape (T, 3), [rad/s].
        p_dot: Velocity of the origin, shape (T, 3), [m/s].
        w_dot: Angular acceleration, shape (T, 3), [rad/s^2].
        p_ddot: Classical acceleration of the origin, shape (T, 3), [m/s^2].
    """

    R: Array
    p: Array
    w: Array
    p_dot: Array
    w_dot: Array
    p_ddot: Array

    @property
    def arrays(self) -> tuple[Array, ...]:
        """R, p, w, p_dot, w_dot, p_ddot."""
        return self.R, self.p, self.w, self.p_dot, self.w_dot, self.p_ddot

    @classmethod
    def at_rest(cls, samples: int, R: Array | None = None, p: Array | None = None) -> RigidMotion:
        """Build a frame at rest at a placement (identity by default)."""
        zero = np.zeros((samples, 3))
        axes = np.broadcast_to(np.eye(3) if R is None else R, (samples, 3, 3))
        return cls(
            axes, np.broadcast_to(np.zeros(3) if p is None else p, (samples, 3)), zero, zero, zero, zero
        )

    @classmethod
    def of_body(cls, motion: Motion, body: int) -> RigidMotion:
        """Build the motion of a body of a swept tree, in the tree's base."""
        return cls(*(x[:, body] for x in motion.arrays))

    def then(self, inner: RigidMotion) -> RigidMotion:
        """Compose motions: express `inner`, a motion relative to this frame, in this frame's reference."""
        r, w1, pd1 = rotate(self.R, inner.p), rotate(self.R, inner.w), rotate(self.R, inner.p_dot)
        wd1, pdd1 = rotate(self.R, inner.w_dot), rotate(self.R, inner.p_ddot)
        return RigidMotion(
            np.matmul(self.R, inner.R),
            self.p + r,
            self.w + w1,
            self.p_dot + cross(self.w, r) + pd1,
            self.w_dot + cross(self.w, w1) + wd1,
            self.p_ddot + cross(self.w_dot, r) + cross(self.w, cross(self.w, r) + 2 * pd1) + pdd1,
        )

    def seen_from(self, base: RigidMotion) -> RigidMotion:
        """Compute this frame's motion relative to `base`, another frame in the same reference."""
        r, w = self.p - base.p, self.w - base.w
        slide = self.p_dot - base.p_dot - cross(base.w, r)
        w_dot = self.w_dot - base.w_dot - cross(base.w, w)
        p_ddot = (
            self.p_ddot - base.p_ddot - cross(base.w_dot, r) - cross(base.w, cross(base.w, r) + 2 * slide)
        )
        R = np.matmul(np.swapaxes(base.R, 1, 2), self.R)
        return RigidMotion(R, *(rotate_back(base.R, x) for x in (r, w, slide, w_dot, p_ddot)))
