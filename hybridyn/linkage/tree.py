"""Positions, velocities and accelerations of a tree of bodies, for a batch of samples.

The forward recursion runs level by level, in the axes of the tree's base, which is at rest. Velocities and
accelerations are classical: those of the origin of each body frame, and the angular ones.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import DTypeLike

from ..joints.displacement import turn_parts
from ..joints.kinds import Turn
from ..spatial import (
    Array,
    Index,
    Mask,
    added,
    compose,
    cos,
    cross,
    multiplied,
    rotate,
    run,
    samples_inside,
    select,
    sin,
    slices,
)
from .joints import TreeJoint
from .motion import Motion

#: Axes of the base.
_AXES = np.eye(3)
#: The one number of velocities at rest.
_ZERO = np.zeros(1)
_ZERO.flags.writeable = False


class Jacobians(Protocol):
    """A tree, or what gives Jacobians like one."""

    def jacobian(self, motion: Motion, body: int) -> Array:
        """Compute the Jacobian of a body's origin in base axes, shape (T, 6, nv), as `Tree.jacobian`."""


class Tree:
    """A tree of bodies connected to a base by joints, parents first.

    Attributes:
        joints: The joints; the child of `joints[i]` is body i + 1.
        nq: Number of position coordinates.
        nv: Number of velocities.
        q_slices: Slice of q of each joint.
        v_slices: Slice of v of each joint.
        dof_body: Child body of the joint of each freedom, shape (nv,).
        support: Mask of the freedoms that move each body, shape (bodies, nv).
        S_linear: Linear part of the motion subspace of each freedom, shape (nv, 3), body frame.
        S_angular: Angular part of it, shape (nv, 3), body frame.
        linear: Mask of the freedoms whose rates are in m/s, shape (nv,).
    """

    def __init__(self, joints: list[TreeJoint]) -> None:
        self.joints = tuple(joints)
        self.nq, self.nv = sum(j.kind.nq for j in joints), sum(j.kind.nv for j in joints)
        self.q_slices = slices(j.kind.nq for j in joints)
        self.v_slices = slices(j.kind.nv for j in joints)
        self.dof_body = np.repeat(np.arange(1, len(joints) + 1), [j.kind.nv for j in joints]).astype(int)
        self._placement = np.array([np.column_stack([j.R, j.p]) for j in joints]).reshape(-1, 3, 4)
        S = np.concatenate([j.S for j in joints], axis=1) if joints else np.zeros((6, 0))
        self.S_linear, self.S_angular = S[:3].T.copy(), S[3:].T.copy()
        self._S = np.stack([self.S_linear, self.S_angular]).transpose(1, 2, 0)  # samples stay innermost
        self.linear: Mask = np.logical_not(self.S_angular.any(axis=1))
        depth = np.zeros(len(joints) + 1, dtype=int)
        self.support = np.zeros((len(joints) + 1, self.nv), dtype=bool)
        for i, joint in enumerate(joints):
            depth[i + 1] = depth[joint.parent] + 1
            self.support[i + 1] = self.support[joint.parent]
            self.support[i + 1, self.v_slices[i]] = True
        parents = np.array([j.parent for j in joints], dtype=int)
        self._levels = []
        for level in range(1, int(depth.max(initial=0)) + 1):
            children = np.flatnonzero(depth == level)
            self._levels.append((run(children), run(parents[children - 1]), run(children - 1)))
        self._number_kind = np.result_type(self._placement, float)
        self._turning = [
            self._turns(turn)
            for turn in (Turn.ANGLE, Turn.CIRCLE)
            if any(j.kind.single and j.kind.turn is turn for j in joints)
        ]
        self._sliding, self._sliding_q, _ = self._where(lambda j: j.kind.single and j.slope != 0.0)
        self._adding = self._where(lambda j: j.kind.additive)
        self._others = [i for i, j in enumerate(joints) if not j.kind.additive]
        self._of_several = [i for i, j in enumerate(joints) if not j.kind.single]
        single, _, self._single_dofs = self._where(lambda j: j.kind.single)
        self._single = run(single + 1)
        self._single_S = [S[self._single_dofs, :, None] for S in (self.S_linear, self.S_angular)]
        slides = np.array([j.slope * (j.R @ j.axis) for j in joints]).reshape(-1, 3)
        self._slides = slides[self._sliding, :, None]

    def _turns(self, turn: Turn) -> tuple[Turn, Index | slice, Index, Array]:
        """Return joints that turn so, their entries in q, and their C0, C1, C2, shape (3, joints, 3, 3, 1).

        Their rotations are C0 + C1 cos + C2 sin.
        """
        numbers, at, _ = self._where(lambda j: j.kind.single and j.kind.turn is turn)
        own = turn_parts(np.array([self.joints[i].axis for i in numbers]))
        parts = np.matmul(self._placement[numbers, None, :, :3], own).swapaxes(0, 1)
        return turn, run(numbers), at, parts[..., None]

    def _where(self, chosen: Callable[[TreeJoint], bool]) -> tuple[Index, Index, Index]:
        """Return the indices of the joints that are chosen, and of their first entries in q and in v."""
        numbers = [i for i, j in enumerate(self.joints) if chosen(j)]
        starts = ([parts[i].start for i in numbers] for parts in (self.q_slices, self.v_slices))
        q, v = (np.array(start, dtype=int) for start in starts)
        return np.array(numbers, dtype=int), q, v

    def _kind(self, x: Array) -> DTypeLike:
        """Return the type of what is computed at numbers or symbols."""
        return self._number_kind if x.dtype == self._number_kind else np.result_type(x, self._number_kind)

    def neutral(self) -> Array:
        """Return the zero position, shape (nq,)."""
        return np.concatenate([np.zeros(0), *(joint.neutral for joint in self.joints)])

    def by_joint(
        self, function: Callable[..., Array], positions: Sequence[Array], rates: Sequence[Array]
    ) -> Array:
        """Apply a function of `joints.displacement` joint by joint, on numbers or symbols.

        Args:
            function: Takes a joint's kind, and its slice of each of `positions` and of each of `rates`.
            positions: Arrays over coordinates, shape (..., nq).
            rates: Arrays over freedoms, shape (..., nv).
        """
        parts = [
            function(joint.kind, *(x[..., at] for x in positions), *(x[..., to] for x in rates))
            for joint, at, to in zip(self.joints, self.q_slices, self.v_slices, strict=True)
        ]
        return np.concatenate([(*positions, *rates)[0][..., :0], *parts], axis=-1)

    def integrate(self, q: Array, dq: Array) -> Array:
        """Integrate constant joint twists dq from q over unit time, shapes (T, nq), (T, nv)."""
        out = q.copy(order="K")
        _, single, dofs = self._adding
        out[:, single] += dq[:, dofs]
        for i in self._others:
            at, moved = self.q_slices[i], dq[:, self.v_slices[i]]
            if moved.any():  # a prescribed platform keeps its position to the last digit
                out[:, at] = self.joints[i].integrate(q[:, at], moved)
        return out

    def bending(self, v: Array) -> Array:
        """Compute the second time derivative of the displacement of constant rates, shape (T, nv)."""
        out = np.zeros_like(v)
        for i in self._others:
            out[:, self.v_slices[i]] = self.joints[i].bending(v[:, self.v_slices[i]])
        return out

    def difference(self, q0: Array, q1: Array) -> Array:
        """Compute the joint twists dq with `integrate(q0, dq) = q1`, shape (T, nv)."""
        out = np.zeros((len(q0), self.nv))
        _, single, dofs = self._adding
        out[:, dofs] = q1[:, single] - q0[:, single]
        for i in self._others:
            here, there = (q[:, self.q_slices[i]] for q in (q0, q1))
            if (here != there).any():
                out[:, self.v_slices[i]] = self.joints[i].difference(here, there)
        return out

    def local(self, q: Array) -> tuple[Array, Array]:
        """Compute child frames in their parents: rotations (T, joints, 3, 3), origins (T, joints, 3)."""
        frames = self._local(q)
        return frames[..., :3], frames[..., 3]

    def _local(self, q: Array) -> Array:
        """Compute child frames in their parents, axes beside origins, shape (T, joints, 3, 4)."""
        frames = np.empty((len(self.joints), 3, 4, len(q)), self._kind(q))  # samples innermost in memory
        frames[:] = self._placement[..., None]
        R, p = frames[:, :, :3], frames[:, :, 3]
        for turn, numbers, at, (still, by_cos, by_sin) in self._turning:
            x = q.T[at]
            c, s = (cos(x), sin(x)) if turn is Turn.ANGLE else (x, q.T[at + 1])
            turned = added(still, multiplied(by_cos, c[:, None, None]))
            R[numbers] = added(turned, multiplied(by_sin, s[:, None, None]))
        if len(self._sliding):
            p[self._sliding] += self._slides * q.T[self._sliding_q][:, None]
        out = frames.transpose(3, 0, 1, 2)
        for i in self._of_several:
            joint = self.joints[i]
            own, shift = joint.transform(q[:, self.q_slices[i]])
            out[:, i, :, :3], out[:, i, :, 3] = compose(joint.R, own), joint.p + rotate(joint.R, shift)
        return out

    def _placements(self, q: Array) -> tuple[Array, Array]:
        """Compute axes and origins of all bodies in the base, shapes (T, bodies, 3, 3), (T, bodies, 3)."""
        local, n = self._local(q), len(self.joints) + 1
        R, p = (samples_inside((len(q), n, *shape), local.dtype) for shape in ((3, 3), (3,)))
        R[:, 0] = _AXES
        for level, (children, parents, joints) in enumerate(self._levels):
            own = select(local, joints)
            if level:
                own = compose(select(R, parents), own)
            R[:, children] = own[..., :3]
            p[:, children] = added(select(p, parents), own[..., 3]) if level else own[..., 3]
        return R, p

    def sweep(
        self, q: Array, v: Array | None = None, a: Array | None = None, at: Motion | None = None
    ) -> Motion:
        """Compute the motion of every body; omitted rates and accelerations are zero.

        Without `a`, `w_dot` and `p_ddot` are the accelerations at zero joint accelerations (J_dot q_dot).

        Args:
            q: Joint positions, shape (T, nq).
            v: Joint rates, shape (T, nv).
            a: Joint accelerations, shape (T, nv).
            at: A motion of this tree through the same positions, whose placements are taken over.
        """
        T, n = len(q), len(self.joints) + 1
        R, p = self._placements(q) if at is None else (at.R, at.p)
        if v is None:
            rest = np.ndarray((T, n, 3), buffer=_ZERO, strides=(0, 0, 0))  # faster than `broadcast_to`
            return Motion(R, p, rest, rest, rest, rest, q)
        w, p_dot, w_dot, p_ddot = (samples_inside((T, n, 3), self._kind(v)) for _ in range(4))
        self._sweep_rates(R, p, v, a, (w, p_dot, w_dot, p_ddot))
        return Motion(R, p, w, p_dot, w_dot, p_ddot, q)

    def _sweep_rates(self, R: Array, p: Array, v: Array, a: Array | None, out: tuple[Array, ...]) -> None:
        """Fill in w, p_dot, w_dot, p_ddot of `Motion` for body placements (R, p), parents first."""
        w, p_dot, w_dot, p_ddot = out
        rel_p, rel_w = self._joint_rates(R, v)
        acc_p, acc_w = cross(rel_w, rel_p), None
        if a is not None:
            own_p, acc_w = self._joint_rates(R, a)
            acc_p = acc_p + own_p
        for level, (children, parents, _) in enumerate(self._levels):
            slide, turn = select(rel_p, children), select(rel_w, children)
            pdd1, wd1 = select(acc_p, children), 0.0 if acc_w is None else select(acc_w, children)
            w1, pd1 = turn, slide
            if level:
                r = select(p, children) - select(p, parents)
                w0, wd0 = select(w, parents), select(w_dot, parents)
                sweep = cross(w0, r)
                w1, pd1 = w0 + turn, select(p_dot, parents) + sweep + slide
                wd1 = wd0 + cross(w0, turn) + wd1
                pdd1 = select(p_ddot, parents) + cross(wd0, r) + cross(w0, sweep + 2.0 * slide) + pdd1
            w[:, children], p_dot[:, children] = w1, pd1
            w_dot[:, children], p_ddot[:, children] = wd1, pdd1

    def _joint_rates(self, R: Array, rates: Array) -> tuple[Array, Array]:
        """Compute S times the joint rates per body, base axes: linear and angular, shape (T, bodies, 3)."""
        T, n = len(R), len(self.joints) + 1
        linear, angular = np.zeros((2, n, 3, T), self._kind(rates))  # samples innermost in memory
        own = rates.T[self._single_dofs][:, None]
        linear[self._single], angular[self._single] = (multiplied(S, own) for S in self._single_S)
        for i in self._of_several:
            at = self.v_slices[i]
            linear[i + 1] = self.S_linear[at].T @ rates[:, at].T
            angular[i + 1] = self.S_angular[at].T @ rates[:, at].T
        return rotate(R, linear.transpose(2, 0, 1)), rotate(R, angular.transpose(2, 0, 1))

    def columns(self, motion: Motion) -> Array:
        """Compute the velocity of each freedom's child body at unit rate, base axes.

        Returns:
            Velocity of the body's origin beside its angular velocity, shape (T, nv, 3, 2). A point x of a
            body further out moves with `linear + angular x (x - origin of dof_body)`.
        """
        return compose(select(motion.R, self.dof_body), self._S)

    def jacobian(self, motion: Motion, body: int, point: Array | None = None) -> Array:
        """Compute the Jacobian of a point of a body (velocity, then angular velocity) in base axes.

        Args:
            motion: Motion of the tree.
            body: Index of the body.
            point: The point, shape (T, 3), [m], base frame; the body's origin by default.

        Returns:
            Shape (T, 6, nv).
        """
        point = motion.p[:, body] if point is None else point
        columns = self.columns(motion)
        linear, angular = columns[..., 0], columns[..., 1]
        at_point = linear + cross(angular, point[:, None] - select(motion.p, self.dof_body))
        J = np.concatenate([at_point, angular], axis=-1) * self.support[body][:, None]
        return np.swapaxes(J, 1, 2)
