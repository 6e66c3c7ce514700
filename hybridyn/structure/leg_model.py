"""Models of the legs of one module: H and F_b by RNEA; A, D and S1 by CRBA.

A free-flyer represents the base body, and the leg trees are attached to it (appendices A to C of the paper).
Gravity is zero in these models, because the acceleration of the base already contains it. Outputs have no
inertia in them, because the module equations add it. `LegModel` calls Pinocchio, `LongLegs` does without.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..linkage.motion import Motion
from ..linkage.tree import Tree
from ..spatial import Array, cross, hat, indices, rotate, rotate_back
from .bodies import Body

if TYPE_CHECKING:
    import pinocchio as pin


class LegModel:
    """Pinocchio model of a module's leg trees, without the joints that move no leg mass.

    Pinocchio is imported with the first motion, because it takes half of a program's start and the compiled
    models do without it.

    Attributes:
        columns: Freedoms of the module's tree, in the order of the model's velocities after the free-flyer.
    """

    def __init__(self, tree: Tree, bodies: list[Body | None]) -> None:
        """Choose the joints of the model.

        Args:
            tree: The module's tree after the cuts.
            bodies: For each body of the tree after the base, its inertia, or None for an output.
        """
        self._built_from = (tree, bodies)
        heavy = [body is not None and not body.massless for body in bodies]
        for i in reversed(range(len(tree.joints))):
            parent = tree.joints[i].parent
            if heavy[i] and parent:
                heavy[parent - 1] = True
        path: list[tuple[int, ...]] = [()]  # to each body of the tree
        for i, joint in enumerate(tree.joints):
            path.append((*path[joint.parent], i))
        order = [at[-1] for at in sorted(path[1:]) if heavy[at[-1]]]  # depth-first
        number = {0: 1} | {i + 1: n for n, i in enumerate(order, 2)}  # in the model, where the base is 1
        self._joints = [(i, number[tree.joints[i].parent]) for i in order]  # with the parent's number
        self._q_columns = indices(tree.q_slices[i] for i, _ in self._joints)
        self.columns = indices(tree.v_slices[i] for i, _ in self._joints)
        self._nv = tree.nv
        self.empty = not len(self.columns)
        self._base_q = np.array([0.0, 0, 0, 0, 0, 0, 1])

    @cached_property
    def model(self) -> pin.Model:
        """The Pinocchio model; its first joint is a free-flyer."""
        import pinocchio as pin

        from .pinocchio_model import pinocchio_inertia, pinocchio_joint

        tree, bodies = self._built_from
        model = pin.Model()
        model.gravity.linear = np.zeros(3)
        model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "base")
        for i, parent in self._joints:
            joint, body = tree.joints[i], bodies[i]
            number = model.addJoint(parent, pinocchio_joint(joint), pin.SE3(joint.R, joint.p), joint.name)
            if body is not None:
                model.appendBodyToJoint(number, pinocchio_inertia(body), pin.SE3.Identity())
        return model

    @cached_property
    def _data(self) -> pin.Data:
        """Memory of the model's algorithms."""
        data = self.model.createData()
        assert self.model.check(data), "joints must be added depth-first"
        return data

    @cached_property
    def _pool(self) -> pin.ModelPool:
        """Memory of the algorithms that compute many samples."""
        import pinocchio as pin

        return pin.ModelPool(self.model, 1)

    def __reduce__(self) -> tuple[type[LegModel], tuple[Tree, list[Body | None]]]:
        """Pickle the arguments of the constructor, because Pinocchio's model pools cannot be pickled."""
        return LegModel, self._built_from

    def rnea(self, V: Array, V_dot: Array, q: Array, v: Array, a: Array) -> tuple[Array, Array]:
        """Compute the inverse dynamic model of the legs, Eqs. (54)-(62).

        Args:
            V: Twist of the base, shape (T, 6), base frame.
            V_dot: Spatial acceleration of the base minus gravity, shape (T, 6), base frame.
            q: Positions of the module's tree, shape (T, nq).
            v: Rates, shape (T, nv).
            a: Accelerations, shape (T, nv).

        Returns:
            F_b: Wrench of the base on the legs at the base frame's origin, shape (T, 6), [N, N m].
            H: Generalised forces of the legs, shape (T, nv); zero for freedoms that move no leg mass.
        """
        T = len(V)
        H = np.zeros((T, self._nv))
        if self.empty or not T:
            return np.zeros((T, 6)), H
        Q = np.asfortranarray(np.concatenate([np.tile(self._base_q, (T, 1)), q[:, self._q_columns]], 1).T)
        U = np.asfortranarray(np.concatenate([V, v[:, self.columns]], axis=1).T)
        A = np.asfortranarray(np.concatenate([V_dot, a[:, self.columns]], axis=1).T)
        import pinocchio as pin

        out = (
            pin.rneaInParallel(1, self._pool, Q, U, A).reshape(-1, T, order="F").T
        )  # Pinocchio returns one sample as a flat array
        H[:, self.columns] = out[:, 6:]
        return out[:, :6].copy(), H

    def crba(self, q: Array) -> Array:
        """Compute the mass matrix of the legs and the base, M_leg = [[S1, D^T], [D, A]], Eqs. (63)-(75).

        Args:
            q: Positions of the module's tree, shape (T, nq).

        Returns:
            Shape (T, 6 + nv, 6 + nv): the base first, then the freedoms of the tree.
        """
        T = len(q)
        M = np.zeros((T, 6 + self._nv, 6 + self._nv))
        if self.empty:
            return M
        import pinocchio as pin

        at = np.concatenate([np.arange(6), 6 + self.columns])
        full = np.concatenate([np.tile(self._base_q, (T, 1)), q[:, self._q_columns]], axis=1)
        out = np.empty((T, len(at), len(at)))
        for t in range(T):
            out[t] = pin.crba(self.model, self._data, full[t])
        upper = np.triu(out)
        M[:, at[:, None], at] = upper + np.swapaxes(np.triu(out, 1), 1, 2)
        return M


class LongLegs:
    """Leg trees of a module with hundreds of freedoms, with the same two methods as `LegModel`.

    The memory grows with the square of the number of freedoms. Pinocchio's `Data` has tensors that grow with
    the cube: several GB for a loop of 400 joints. Here the wrench and the inertia of every body are expressed
    about the origin of the base, and summed over the bodies that each freedom moves.
    """

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
        columns = self.tree.columns(motion)
        linear, angular = columns[..., 0], columns[..., 1]
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
