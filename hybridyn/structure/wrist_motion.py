"""Compute the motion of cut wrists: Jacobians, and joint rates from the bodies that the wrists connect."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..linkage.elimination import least_squares
from ..linkage.gimbal_lock import GIMBAL_LOCK, warn_of_gimbal_lock
from ..linkage.joints import TreeJoint
from ..linkage.tree import Motion
from ..spatial import Array, Index, cross, to_body_axes
from .cut import Cut
from .module_spec import WristSpec

#: A wrist that carries a platform is near gimbal lock if the determinant of its axes is smaller than this.
#: Its joint rates, from which the rates of the platform are computed, grow with the reciprocal.
NEAR_LOCK = 1e-2


class WristMotion:
    """Motion of the cut wrists of one module; wrists are given by number.

    Attributes:
        specs: Numbers of each wrist.
    """

    def __init__(self, specs: tuple[WristSpec, ...], cut: Cut, length: float, col_scale: Array) -> None:
        """Store the data on which the motion of the wrists depends.

        Args:
            specs: Numbers of each wrist.
            cut: The trees of the module.
            length: Length of the module [m].
            col_scale: Unit of each freedom of the spanning tree, shape (nv,).
        """
        self.specs = specs
        self._cut, self._length, self._col_scale = cut, length, col_scale

    def joints(self, wrist: int) -> tuple[TreeJoint, ...]:
        """Return the joints of a wrist as a separate chain, whose base is the wrist's parent body."""
        joints = (self._cut.spanning.joints[j] for j in self.specs[wrist].joints)
        return tuple(replace(joint, parent=i) for i, joint in enumerate(joints))

    def positions(self, wrist: int) -> Index:
        """Return the indices of a wrist's position coordinates in the spanning tree."""
        every = np.arange(self._cut.spanning.nq)
        return np.concatenate([every[self._cut.spanning.q_slices[i]] for i in self.specs[wrist].joints])

    def columns(self, wrist: int) -> Index:
        """Return the indices of a wrist's freedoms in the spanning tree."""
        every = np.arange(self._cut.spanning.nv)
        return np.concatenate([every[self._cut.spanning.v_slices[i]] for i in self.specs[wrist].joints])

    def near_gimbal_lock(self, spanning: Motion) -> Index:
        """Return the samples at which a wrist that carries a platform is near gimbal lock."""
        near = np.zeros(len(spanning.p), dtype=bool)
        for number, wrist in enumerate(self.specs):
            if wrist.carries and len(wrist.joints) == 3:
                near |= np.abs(np.linalg.det(self.jacobian(spanning, number)[:, 3:])) <= NEAR_LOCK
        return np.flatnonzero(near)

    def jacobian(self, motion: Motion, wrist: int) -> Array:
        """Compute the Jacobian from the scaled joint rates of a wrist to the twist of its end.

        Returns:
            Shape (T, 6, joints of the wrist). The twist is relative to the wrist's parent, at the origin of
            the end, in base axes, with the linear part divided by the length of the module.
        """
        spanning, end, cols = self._cut.spanning, self.specs[wrist].end, self.columns(wrist)
        linear, angular = (c[:, cols] for c in spanning.columns(motion))
        shift = cross(angular, motion.p[:, end, None] - motion.p[:, spanning.dof_body[cols]])
        S = np.swapaxes(np.concatenate([(linear + shift) / self._length, angular], axis=-1), 1, 2)
        return S * self._col_scale[cols]

    def link_jacobian(self, spanning: Motion, motion: Motion, body: int) -> Array:
        """Compute the Jacobian from x_dot to the twist of a link inside a wrist, in the link's frame.

        Args:
            spanning: Motion of the spanning tree.
            motion: Motion of the tree after the cuts.
            body: Number of the link's body in the spanning tree.

        Returns:
            Shape (T, 6, n).
        """
        tree, number = self._cut.tree, next(i for i, w in enumerate(self.specs) if body - 1 in w.joints)
        wrist, cols = self.specs[number], self.columns(number)
        parent = self._cut.tree_body(self._cut.spanning.joints[wrist.joints[0]].parent)
        target = self._cut.tree_body(wrist.target)
        end, here = spanning.p[:, wrist.end], spanning.p[:, body]
        miss = tree.jacobian(motion, target, end) - tree.jacobian(motion, parent, end)
        miss[:, :3] /= self._length
        rates = np.matmul(np.linalg.pinv(self.jacobian(spanning, number), rcond=1e-12), miss)
        own = self._cut.spanning.jacobian(spanning, body, here)[:, :, cols] * self._col_scale[cols]
        J = tree.jacobian(motion, parent, here) + np.matmul(own, rates)
        return to_body_axes(spanning.R[:, body], J)

    def rates_of(self, spanning: Motion, motion: Motion, wrist: int, X: Array) -> Array:
        """Compute the least-norm joint rates with which a wrist follows the bodies that it connects.

        The linear map of `recover_rates`, for many motions of one posture.

        Args:
            spanning: Motion of the spanning tree.
            motion: Motion of the tree after the cuts.
            wrist: Number of the wrist.
            X: Columns of rates of the tree after the cuts, shape (T, n, k).

        Returns:
            Shape (T, joints of the wrist, k).
        """
        tree, spec = self._cut.tree, self.specs[wrist]
        parent = self._cut.tree_body(self._cut.spanning.joints[spec.joints[0]].parent)
        end = spanning.p[:, spec.end]
        relative = tree.jacobian(motion, self._cut.tree_body(spec.target), end)
        miss = np.matmul(relative - tree.jacobian(motion, parent, end), X)
        miss[:, :3] /= self._length
        rates = least_squares(self.jacobian(spanning, wrist), miss, relative=GIMBAL_LOCK)
        return rates * self._col_scale[self.columns(wrist), None]

    def recover_rates(self, q: Array, v: Array, target: Motion) -> None:
        """Compute, in place, the least-norm rates of the wrists for which their ends follow their targets.

        Args:
            q: Positions of the spanning tree, shape (T, nq).
            v: Rates of the spanning tree, shape (T, nv); those of the wrists are overwritten.
            target: Motion of the tree after the cuts, with rates.
        """
        self._recover(q, v, None, target)

    def recover_accelerations(
        self, q: Array, v: Array, a: Array, target: Motion, at: Motion | None = None
    ) -> None:
        """Compute, in place, the least-norm accelerations of the wrists for which their ends follow.

        Args:
            q: Positions of the spanning tree, shape (T, nq).
            v: Rates of the spanning tree, shape (T, nv).
            a: Accelerations of the spanning tree, shape (T, nv); those of the wrists are overwritten.
            target: Motion of the tree after the cuts, with accelerations.
            at: A known motion of the spanning tree at the same positions, or None.
        """
        self._recover(q, v, a, target, at)

    def _recover(self, q: Array, v: Array, a: Array | None, target: Motion, at: Motion | None = None) -> None:
        """Compute, in place, the rates of the wrists or, if `a` is given, their accelerations."""
        unknown = v if a is None else a
        motion: Motion | None = None
        for number, wrist in enumerate(self.specs):
            cols = self.columns(number)
            unknown[:, cols] = 0.0
            if motion is None:
                motion = at = self._cut.spanning.sweep(q, v, a, at)
            miss = _miss(motion, wrist.end, target, self._cut.tree_body(wrist.target), a is not None)
            S = self.jacobian(motion, number)
            miss[:, :3] /= self._length
            unknown[:, cols] = least_squares(S, miss, relative=GIMBAL_LOCK) * self._col_scale[cols]
            warn_of_gimbal_lock(S)
            if wrist.carries:  # bodies beyond a platform move with it: sweep again before the next wrist
                motion = None


def _miss(motion: Motion, end: int, target: Motion, body: int, accelerations: bool) -> Array:
    """Compute the difference between the rates (or accelerations) of a wrist's target and of its end.

    Args:
        motion: Motion of the spanning tree, the wrist's rates (or accelerations) zero.
        end: Number of the end in the spanning tree.
        target: Motion of the tree after the cuts.
        body: Number of the wrist's target in the tree after the cuts.
        accelerations: Whether to compare accelerations instead of rates.

    Returns:
        Linear and angular difference at the origin of the end, base axes, shape (T, 6).
    """
    r = motion.p[:, end] - target.p[:, body]
    w = target.w[:, body]
    if not accelerations:
        linear = target.p_dot[:, body] + cross(w, r) - motion.p_dot[:, end]
        return np.concatenate([linear, w - motion.w[:, end]], axis=-1)
    w_dot = target.w_dot[:, body]
    linear = target.p_ddot[:, body] + cross(w_dot, r) + cross(w, cross(w, r)) - motion.p_ddot[:, end]
    return np.concatenate([linear, w_dot - motion.w_dot[:, end]], axis=-1)
