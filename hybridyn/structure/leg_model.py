"""Pinocchio model of the legs of one module: H and F_b by RNEA; A, D and S1 by CRBA.

A free-flyer represents the base body, and the leg trees are attached to it (appendices A to C of the paper).
Gravity is zero in this model, because the acceleration of the base already contains it. Outputs have no
inertia in this model, because the module equations add it.
"""

from __future__ import annotations

import itertools
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..linkage.joints import TreeJoint
from ..linkage.tree import Tree
from ..spatial import Array
from .bodies import Body

if TYPE_CHECKING:
    import pinocchio as pin


def pinocchio_joint(joint: TreeJoint) -> pin.JointModel:
    """Return the Pinocchio joint of a `TreeJoint`, of an axis-aligned type if the axis allows it."""
    import pinocchio as pin

    aligned = {
        "revolute": (pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ),
        "continuous": (pin.JointModelRUBX, pin.JointModelRUBY, pin.JointModelRUBZ),
        "prismatic": (pin.JointModelPX, pin.JointModelPY, pin.JointModelPZ),
    }
    if joint.kind in aligned:
        for i in range(3):
            if joint.axis[i] == 1.0:
                return aligned[joint.kind][i]()
        unaligned = {
            "revolute": pin.JointModelRevoluteUnaligned,
            "continuous": _continuous,
            "prismatic": pin.JointModelPrismaticUnaligned,
        }
        return unaligned[joint.kind](joint.axis)
    return {
        "spherical": pin.JointModelSpherical,
        "planar": pin.JointModelPlanar,
        "floating": pin.JointModelFreeFlyer,
    }[joint.kind]()


def _continuous(axis: Array) -> pin.JointModel:
    """Return a continuous joint about any axis, by the URDF reader, because Python cannot set the axis."""
    import pinocchio as pin

    x, y, z = (float(value) for value in axis)
    return pin.buildModelFromXML(
        '<robot name="one"><link name="a"/><link name="b"><inertial><mass value="1"/>'
        '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        f'<joint name="j" type="continuous"><parent link="a"/><child link="b"/><axis xyz="{x!r} {y!r} '
        f'{z!r}"/>'
        "</joint></robot>"
    ).joints[1]


def pinocchio_inertia(body: Body) -> pin.Inertia:
    """Return Pinocchio's inertia of a body.

    The entries are set one by one, because the constructor rejects unphysical inertias.
    """
    import pinocchio as pin

    out = pin.Inertia.Zero()
    out.mass = body.mass
    out.lever = body.com
    # Symmetric to the last digit, because Pinocchio checks symmetry with an absolute tolerance.
    out.inertia = (body.inertia + body.inertia.T) / 2
    return out


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
        children: dict[int, list[int]] = {}
        for i, joint in enumerate(tree.joints):
            children.setdefault(joint.parent, []).append(i)
        number = {0: 1}  # in the model, of each body of the tree; 1 is the base
        self._joints: list[tuple[int, int]] = []  # of the tree, with the parent's number, depth-first
        stack = [*reversed(children.get(0, []))]
        while stack:
            i = stack.pop()
            if not heavy[i]:
                continue
            self._joints.append((i, number[tree.joints[i].parent]))
            number[i + 1] = len(self._joints) + 1
            stack.extend(reversed(children.get(i + 1, [])))
        q_columns = [range(*tree.q_slices[i].indices(tree.nq)) for i, _ in self._joints]
        v_columns = [range(*tree.v_slices[i].indices(tree.nv)) for i, _ in self._joints]
        self._q_columns, self.columns = (
            np.array([*itertools.chain(*columns)], dtype=int) for columns in (q_columns, v_columns)
        )
        self._nv = tree.nv
        self.empty = not len(self.columns)
        self._base_q = np.array([0.0, 0, 0, 0, 0, 0, 1])

    @cached_property
    def model(self) -> pin.Model:
        """The Pinocchio model; its first joint is a free-flyer."""
        import pinocchio as pin

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
