"""The rows of the wrists that were cut: each holds the end of its branch of the whole tree to its target."""

from dataclasses import replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from ..linkage.closures import Closures
from ..linkage.elimination import least_squares
from ..linkage.motion import Motion
from ..linkage.tree import Tree
from ..logs import warn
from ..spatial import Array, Index, Mask, indices, rotate, select, to_body_axes
from .cut import Cut

#: A wrist whose reciprocal condition falls below this is in gimbal lock.
GIMBAL_LOCK = 1e-9
#: A wrist that carries a platform is near gimbal lock if the determinant of its axes is smaller than this.
#: Its joint rates, from which the rates of the platform are computed, grow with the reciprocal.
NEAR_LOCK = 1e-2


class WristRows:
    """Rows of the welds of one module, without units; wrists are given by number.

    The rates of a wrist's joints follow from those of x: K_x x_dot + K_w w = 0, in the least norm.
    """

    def __init__(self, cut: Cut, length: float, unit: Array) -> None:
        """Store the data on which the motion of the wrists depends.

        Args:
            cut: The trees of the module.
            length: Length of the module [m].
            unit: Unit of each freedom of the whole tree, shape (its nv,).
        """
        self._cut, self._specs, self._unit = cut, cut.wrists, unit
        self._scale = np.array([1.0 / length] * 3 + [1.0] * 3)
        ends = np.cumsum([len(cut.tree.joints), *(len(wrist.joints) for wrist in cut.wrists)])
        self._own = [indices(cut.whole.v_slices[first:last]) for first, last in pairwise(ends)]

    @cached_property
    def _welds(self) -> list[Closures]:
        """The weld of each wrist."""
        return [Closures(self._cut.whole, [weld], []) for weld in self._cut.welds]

    @cached_property
    def chains(self) -> list[Tree]:
        """Each wrist as a separate chain, whose base is the wrist's parent body."""
        joints = self._cut.spanning.joints
        return [
            Tree([replace(joints[j], parent=i) for i, j in enumerate(wrist.joints)]) for wrist in self._specs
        ]

    def positions(self, wrist: int) -> Index:
        """Return the indices of a wrist's position coordinates in the spanning tree."""
        return indices(self._cut.spanning.q_slices[i] for i in self._specs[wrist].joints)

    def unit(self, wrist: int) -> Array:
        """Return the units of a wrist's freedoms."""
        return self._unit[self._own[wrist]]

    def near_gimbal_lock(self, motion: Motion) -> Index:
        """Return the samples at which a wrist that carries a platform is near gimbal lock.

        Args:
            motion: Motion of the whole tree.
        """
        near = np.zeros(len(motion.p), dtype=bool)
        for own, wrist in zip(self._own, self._specs, strict=True):
            if wrist.carries and len(wrist.joints) == 3:
                axes = rotate(select(motion.R, self._cut.whole.dof_body[own]), self._cut.whole.S_angular[own])
                near |= np.abs(np.linalg.det(axes)) <= NEAR_LOCK
        return np.flatnonzero(near)

    def jacobian(self, motion: Motion, wrist: int) -> Array:
        """Compute the Jacobian from the scaled joint rates of a wrist to the twist of its end.

        Args:
            motion: Motion of the whole tree.

        Returns:
            Shape (T, 6, joints of the wrist). The twist is relative to the wrist's parent, in the axes of the
            end, with the linear part divided by the length of the module.
        """
        return -self._matrix(motion, wrist)[:, :, self._own[wrist]] * self.unit(wrist)

    def link_jacobian(self, motion: Motion, body: int) -> Array:
        """Compute the Jacobian from x_dot to the twist of a link inside a wrist, in the link's frame.

        Args:
            motion: Motion of the whole tree.
            body: Number of the link's body in the whole tree.

        Returns:
            Shape (T, 6, n).
        """
        J = self._cut.whole.jacobian(motion, body)
        return to_body_axes(motion.R[:, body], np.matmul(J, self.rates(motion, np.eye(self._cut.tree.nv))))

    def of_link(self, motion: Motion, wrist: int, body: int) -> Array:
        """Compute the Jacobian from the scaled joint rates of a wrist to the twist of a link inside it.

        Args:
            motion: Motion of the whole tree.
            body: Number of the link's body in the whole tree.

        Returns:
            Shape (T, 6, joints of the wrist), relative to the wrist's parent, in the link's frame.
        """
        J = self._cut.whole.jacobian(motion, body)[:, :, self._own[wrist]] * self.unit(wrist)
        return to_body_axes(motion.R[:, body], J)

    def rates(self, motion: Motion, X: Array) -> Array:
        """Compute rates of the whole tree with which the wrists follow the bodies that they connect.

        Args:
            motion: Motion of the whole tree (positions suffice).
            X: Columns of rates of the tree after the cuts, shape (T, n, k) or (n, k).

        Returns:
            Shape (T, nv of the whole tree, k); those of wrists in gimbal lock are the least-norm ones.
        """
        out = np.zeros((len(motion.p), self._cut.whole.nv, X.shape[-1]))
        out[:, : X.shape[-2]] = X
        for wrist, own in enumerate(self._own):
            K = self._matrix(motion, wrist)
            out[:, own] = self._followed(K, wrist, np.matmul(K[:, :, : X.shape[-2]], X))
        return out

    def accelerations(self, z_dot: Array, x_ddot: Array, at: Motion) -> Array:
        """Compute accelerations of the whole tree with which the wrists follow the bodies that they connect.

        Args:
            z_dot: Rates of the whole tree, shape (T, its nv).
            x_ddot: Accelerations of the tree after the cuts, shape (T, its nv).
            at: Motion of the whole tree (positions suffice).

        Returns:
            Shape (T, nv of the whole tree); those of wrists in gimbal lock are the least-norm ones.
        """
        assert at.q is not None
        out = self._cut.with_still_wrists(x_ddot)
        motion = self._cut.whole.sweep(at.q, z_dot, out, at)
        for wrist, own in enumerate(self._own):
            miss = self._welds[wrist].rates(motion, z_dot)[1]
            K = self._matrix(motion, wrist)
            out[:, own] = self._followed(K, wrist, miss * self._scale)
            warn_of_gimbal_lock(K[:, :, own] * self.unit(wrist))
        return out

    def _matrix(self, motion: Motion, wrist: int) -> Array:
        """Compute the rows of a weld over the freedoms of the whole tree, shape (T, 6, its nv)."""
        return self._welds[wrist].matrix(motion, (self._scale, np.ones(self._cut.whole.nv)))

    def _followed(self, K: Array, wrist: int, miss: Array) -> Array:
        """Compute the least-norm rates of a wrist that undo `miss`, shape (T, 6) or (T, 6, k)."""
        unit = self.unit(wrist)
        rates = least_squares(K[:, :, self._own[wrist]] * unit, -miss, relative=GIMBAL_LOCK)
        return rates * unit[(..., *[None] * (miss.ndim - 2))]


def is_locked(S: Array) -> Mask:
    """Check at which samples a wrist is in gimbal lock.

    Args:
        S: Joint columns of the wrist, as `WristRows.jacobian` computes them, shape (T, 6, joints).

    Returns:
        Mask, shape (T,).
    """
    s = np.linalg.svd(S, compute_uv=False)
    return s[:, -1] <= GIMBAL_LOCK * s[:, 0]


def warn_of_gimbal_lock(S: Array) -> None:
    """Log a warning if a wrist is in gimbal lock at some sample; its rates there are least-norm."""
    locked = np.flatnonzero(is_locked(S))
    if len(locked):
        warn(
            "gimbal lock of a wrist at %d samples, the first %d: rates of its joints are the least-norm "
            "ones, nothing else is affected",
            len(locked),
            locked[0],
        )
