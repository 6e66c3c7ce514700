"""Leg model for modules with hundreds of freedoms: H, F_b, A, D and S1, without Pinocchio.

The memory grows with the square of the number of freedoms. Pinocchio's `Data` has tensors that grow with the
cube: several GB for a loop of 400 joints. Here the wrench and the inertia of every body are expressed about
the origin of the base, and summed over the bodies that each freedom moves.
"""

from __future__ import annotations

import numpy as np

from ..linkage.tree import Motion, Tree
from ..spatial import Array, cross, hat, rotate, rotate_back
from .bodies import Body


class LongLegs:
    """Leg trees of a module, with the same two methods as `LegModel`."""

    def __init__(self, tree: Tree, bodies: list[Body | None]) -> None:
        """Collect the bodies that have mass.

        Args:
            tree: The module's tree after the cuts.
            bodies: For each body of the tree after the base, its inertia, or None for an output.
        """
        self.tree = tree
        heavy = [(i + 1, b) for i, b in enumerate(bodies) if b is not None and not b.massless]
        self._at = np.array([i for i, _ in heavy], dtype=int)
        self._mass = np.array([b.mass for _, b in heavy])
        self._com = np.array([b.com for _, b in heavy]).reshape(-1, 3)
        self._inertia = np.array([(b.inertia + b.inertia.T) / 2 for _, b in heavy]).reshape(-1, 3, 3)
        self._moved = tree.support[self._at].astype(float)  # (heavy bodies, nv)

    def rnea(self, V: Array, V_dot: Array, q: Array, v: Array, a: Array) -> tuple[Array, Array]:
        """Compute the inverse dynamic model of the legs, Eqs. (54)-(62), as `LegModel.rnea` does."""
        motion = self.tree.sweep(q, v, a)
        R, p, w, p_dot, w_dot, p_ddot = (x[:, self._at] for x in motion.arrays)
        arm = rotate(R, np.broadcast_to(self._com, p.shape))
        c, c_dot = p + arm, p_dot + cross(w, arm)
        c_ddot = p_ddot + cross(w_dot, arm) + cross(w, cross(w, arm))
        w0, wd0 = V[:, None, 3:], V_dot[:, None, 3:]
        start = V_dot[:, None, :3] + cross(w0, V[:, None, :3])
        swept = cross(wd0, c) + cross(w0, cross(w0, c)) + 2.0 * cross(w0, c_dot)
        force = self._mass[:, None] * (start + swept + c_ddot)
        turn, turn_dot = w + w0, w_dot + wd0 + cross(w0, w)
        spin, spin_dot = rotate_back(R, turn), rotate_back(R, turn_dot)
        own = rotate(self._inertia, spin_dot) + cross(spin, rotate(self._inertia, spin))
        wrench = np.concatenate([force, rotate(R, own) + cross(c, force)], axis=-1)
        beyond = np.einsum("bj,tbi->tji", self._moved, wrench, optimize=True)
        H: Array = np.einsum("tji,tji->tj", self._columns(motion), beyond)
        return wrench.sum(axis=1), H

    def crba(self, q: Array) -> Array:
        """Compute the mass matrix M_leg of the legs and the base, Eqs. (63)-(75), as `LegModel.crba` does."""
        nv = self.tree.nv
        out = np.zeros((len(q), 6 + nv, 6 + nv))
        above = self.tree.support[self.tree.dof_body].T  # [i, j]: freedom i moves the body of freedom j
        for t in range(len(q)):
            motion = self.tree.sweep(q[t : t + 1])
            inertias = self._about_base(motion)
            S = self._columns(motion)[0]
            beyond = np.tensordot(self._moved, inertias, axes=(0, 0))
            F = np.einsum("jik,jk->ji", beyond, S)
            A = np.where(above, S @ F.T, 0.0)
            A += np.where(above, 0.0, A.T)
            out[t, :6, :6], out[t, 6:, 6:] = inertias.sum(axis=0), A
            out[t, 6:, :6], out[t, :6, 6:] = F, F.T
        return out

    def _columns(self, motion: Motion) -> Array:
        """Compute the twist at the base's origin for a unit rate of each freedom, shape (T, nv, 6)."""
        linear, angular = self.tree.columns(motion)
        at = linear - cross(angular, motion.p[:, self.tree.dof_body])
        return np.concatenate([at, angular], axis=-1)

    def _about_base(self, motion: Motion) -> Array:
        """Compute the bodies' inertias about the base's origin at the first sample, shape (bodies, 6, 6)."""
        R = motion.R[0, self._at]
        c = motion.p[0, self._at] + rotate(R, self._com)
        out = np.zeros((len(c), 6, 6))
        C, m = hat(c), self._mass[:, None, None]
        out[:, :3, :3], out[:, 3:, :3] = m * np.eye(3), m * C
        out[:, :3, 3:] = -out[:, 3:, :3]
        out[:, 3:, 3:] = R @ self._inertia @ np.swapaxes(R, 1, 2) - m * C @ C
        return out
