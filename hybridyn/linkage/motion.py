"""Motion of frames: positions, velocities and accelerations, for a batch of samples."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..spatial import (
    Array,
    Index,
    Mask,
    added,
    compose,
    cross,
    rotate,
    rotate_back,
    rotation_from_vector,
    symbolic,
)


class Motion(NamedTuple):
    """Motion of frames relative to a reference, in whose axes all vectors are.

    The frames are one, shapes (T, 3), or the bodies of a tree, shapes (T, bodies, 3), computed by one sweep;
    the reference of these is the tree's base, which is body 0, at rest.

    Attributes:
        R: Axes, shape (T, ..., 3, 3).
        p: Origins, shape (T, ..., 3), [m].
        w: Angular velocities, shape (T, ..., 3), [rad/s].
        p_dot: Velocities of the origins, shape (T, ..., 3), [m/s].
        w_dot: Angular accelerations, shape (T, ..., 3), [rad/s^2].
        p_ddot: Classical accelerations of the origins, shape (T, ..., 3), [m/s^2].
        q: Joint positions of the tree that was swept, shape (T, nq); None for frames.
    """

    R: Array
    p: Array
    w: Array
    p_dot: Array
    w_dot: Array
    p_ddot: Array
    q: Array | None = None

    @property
    def arrays(self) -> tuple[Array, ...]:
        """R, p, w, p_dot, w_dot, p_ddot."""
        return self.R, self.p, self.w, self.p_dot, self.w_dot, self.p_ddot

    def take(self, samples: Index | Mask) -> Motion:
        """Return the motion at some samples (indices or a mask)."""
        kept = (np.ascontiguousarray(x.transpose(*range(1, x.ndim), 0)[..., samples]) for x in self.arrays)
        frames = Motion(*(x.transpose(-1, *range(x.ndim - 1)) for x in kept))
        return frames if self.q is None else frames._replace(q=self.q[samples])

    @classmethod
    def at_rest(cls, samples: int, R: Array | None = None, p: Array | None = None) -> Motion:
        """Build one frame at rest at a placement (identity by default)."""
        zero = np.zeros((samples, 3))
        axes = np.broadcast_to(np.eye(3) if R is None else R, (samples, 3, 3))
        origin = np.broadcast_to(np.zeros(3) if p is None else p, (samples, 3))
        return cls(axes, origin, zero, zero, zero, zero)

    def ahead(self, step: Array) -> Motion:
        """Return frames after small times, shape (T,), to second order, at rest."""
        s = step[:, None]
        turn = rotation_from_vector(s * self.w + 0.5 * s * s * self.w_dot)
        p = self.p + s * self.p_dot + 0.5 * s * s * self.p_ddot
        return Motion.at_rest(len(p), np.matmul(turn, self.R), p)

    def of_body(self, body: int) -> Motion:
        """Return the motion of one body of a tree."""
        return Motion(*(x[:, body] for x in self.arrays))

    def then(self, inner: Motion) -> Motion:
        """Express `inner`, the motion of a frame relative to this one, in this frame's reference."""
        r, w1, pd1 = rotate(self.R, inner.p), rotate(self.R, inner.w), rotate(self.R, inner.p_dot)
        wd1, pdd1 = rotate(self.R, inner.w_dot), rotate(self.R, inner.p_ddot)
        swept = cross(self.w, added(cross(self.w, r), 2 * pd1))
        return Motion(
            (compose if symbolic(self.R, inner.R) else np.matmul)(self.R, inner.R),
            added(self.p, r),
            added(self.w, w1),
            added(added(self.p_dot, cross(self.w, r)), pd1),
            added(added(self.w_dot, cross(self.w, w1)), wd1),
            added(added(added(self.p_ddot, cross(self.w_dot, r)), swept), pdd1),
        )

    def seen_from(self, base: Motion) -> Motion:
        """Compute the motion of this frame relative to `base`, another frame in the same reference."""
        r, w = self.p - base.p, self.w - base.w
        slide = self.p_dot - base.p_dot - cross(base.w, r)
        w_dot = self.w_dot - base.w_dot - cross(base.w, w)
        swept = cross(base.w, cross(base.w, r) + 2 * slide)
        p_ddot = self.p_ddot - base.p_ddot - cross(base.w_dot, r) - swept
        R = np.matmul(np.swapaxes(base.R, 1, 2), self.R)
        return Motion(R, *(rotate_back(base.R, x) for x in (r, w, slide, w_dot, p_ddot)))

    def twist(self) -> Array:
        """Compute the twists of the frames, shape (T, ..., 6), own axes: the paper's v_k."""
        return np.concatenate([rotate_back(self.R, self.p_dot), rotate_back(self.R, self.w)], axis=-1)

    def acceleration(self) -> Array:
        """Compute the *spatial* accelerations of the frames, shape (T, ..., 6), own axes."""
        linear = self.p_ddot - cross(self.w, self.p_dot)
        return np.concatenate([rotate_back(self.R, linear), rotate_back(self.R, self.w_dot)], axis=-1)
