"""The two trees of a module: the spanning tree, the tree after the cuts, and the maps between them."""

from __future__ import annotations

import numpy as np

from ..linkage.tree import Motion, Tree
from ..spatial import Array, quaternion_from_rotation, select
from .module_spec import ModuleSpec


class Cut:
    """The spanning tree of a module, its tree after the cuts, and the maps between their coordinates.

    Attributes:
        spanning: Tree of every joint of the module, wrists included, as in the user's q, v, a.
        tree: Tree after the cuts: joints of the legs, and platforms as `floating` joints from the base.
        bodies: For each body of `tree`, its number in `spanning`, shape (bodies,).
    """

    def __init__(self, spec: ModuleSpec) -> None:
        self.spanning, self.tree = Tree(list(spec.spanning)), Tree(list(spec.tree))
        self.bodies = np.array(spec.tree_body)
        self._spec = spec
        self._q_from: list[int] = []
        self._q_to: list[int] = []
        self._v_from: list[int] = []
        self._v_to: list[int] = []
        for i, source in enumerate(spec.tree_joint):
            if source is None:
                continue
            self._q_from += range(*self.spanning.q_slices[source].indices(self.spanning.nq))
            self._q_to += range(*self.tree.q_slices[i].indices(self.tree.nq))
            self._v_from += range(*self.spanning.v_slices[source].indices(self.spanning.nv))
            self._v_to += range(*self.tree.v_slices[i].indices(self.tree.nv))

    def coordinates(
        self, q: Array, v: Array | None, a: Array | None, motion: Motion
    ) -> tuple[Array, Array, Array]:
        """Convert coordinates of the spanning tree to coordinates of `tree`.

        Args:
            q: Positions of the spanning tree, shape (T, nq).
            v: Rates, shape (T, nv), or None for zero.
            a: Accelerations, shape (T, nv), or None for zero.
            motion: Motion of the spanning tree.

        Returns:
            Positions, rates and accelerations of `tree`: shapes (T, its nq), (T, its nv), (T, its nv).
        """
        T = len(q)
        out_q = np.zeros((T, self.tree.nq))
        out_v, out_a = np.zeros((2, T, self.tree.nv))
        out_q[:, self._q_to] = q[:, self._q_from]
        if v is not None:
            out_v[:, self._v_to] = v[:, self._v_from]
        if a is not None:
            out_a[:, self._v_to] = a[:, self._v_from]
        for joint in self._spec.platforms:
            body = self.bodies[joint + 1]
            at, to = self.tree.q_slices[joint], self.tree.v_slices[joint]
            out_q[:, at.start : at.start + 3] = motion.p[:, body]
            out_q[:, at.start + 3 : at.stop] = quaternion_from_rotation(motion.R[:, body])
            if v is not None:
                out_v[:, to] = motion.twist(body)
            if a is not None:
                out_a[:, to] = motion.acceleration(body)
        return out_q, out_v, out_a

    def positions(self, q: Array) -> Array:
        """Convert positions of the spanning tree, shape (T, nq), to those of `tree`, shape (T, its nq)."""
        return self.coordinates(q, None, None, self.spanning.sweep(q))[0]

    def motion(self, spanning: Motion) -> Motion:
        """Select the motion of the bodies of `tree` from the motion of the spanning tree."""
        return Motion(*(select(x, self.bodies) for x in spanning.arrays))

    def to_spanning(self, x: Array, out: Array) -> None:
        """Copy rates (or accelerations) of the legs from `tree` to the spanning tree, in place.

        Args:
            x: Rates of `tree`, shape (T, its nv).
            out: Rates of the spanning tree, shape (T, nv).
        """
        out[:, self._v_from] = x[:, self._v_to]

    def to_tree(self, x: Array, out: Array) -> None:
        """Copy rates (or accelerations, or efforts) of the legs from the spanning tree to `tree`, in place.

        Args:
            x: Rates of the spanning tree, shape (T, nv).
            out: Rates of `tree`, shape (T, its nv).
        """
        out[:, self._v_to] = x[:, self._v_from]

    def positions_to_spanning(self, x: Array, out: Array) -> None:
        """Copy positions of the legs from `tree`, shape (T, its nq), to the spanning tree, in place."""
        out[:, self._q_from] = x[:, self._q_to]

    def tree_body(self, body: int) -> int:
        """Return the number in `tree` of a body of the spanning tree; a wrist's end maps to its target."""
        for wrist in self._spec.wrists:
            if wrist.end == body:
                body = wrist.target
        return int(np.flatnonzero(self.bodies == body)[0])
