"""One tree of a module that holds each joint once; the spanning tree and the cut one are read from it.

The *whole* tree begins with the tree after the cuts, whose coordinates are the paper's x: joints of the legs,
and a `floating` joint from the base for each platform. The joints of each wrist that was cut follow, as a
branch from the body at which the wrist begins. A weld holds the end of the branch to the wrist's target.

    z = [x; positions of the wrists' joints]

The spanning tree has the same joints but for those of the platforms, which its wrists carry. So its
coordinates are a selection of z, and its bodies move like those of the whole tree.
"""

import numpy as np

from ..linkage.closures import TreeClosure
from ..linkage.motion import Motion
from ..linkage.tree import Tree
from ..spatial import Array, Index, indices, quaternion_from_rotation, select
from .module_spec import ModuleSpec


class Cut:
    """The trees of a module, and the maps between their coordinates.

    Attributes:
        whole: Tree of every joint once, and of each platform's pose.
        tree: Tree after the cuts: its first joints.
        spanning: Tree of every joint of the module, wrists included, as in the user's q, v, a.
        wrists: The wrists that were cut.
        welds: For each wrist, the closure from its end to its target, with bodies of `whole`.
        bodies: For each body of `tree`, its number in `spanning`, shape (bodies,).
        q_of, v_of: For each coordinate and each freedom of `spanning`, its number in `whole`.
        q_in, v_in: For each of `whole`, its number in `spanning`; -1 for those of platforms.
        q_from, v_from: Coordinates and freedoms of `spanning` that `tree` has, too.
        q_to, v_to: The same in `tree`.
    """

    def __init__(self, spec: ModuleSpec) -> None:
        self._spec, self.wrists = spec, spec.wrists
        self.whole = Tree(list(spec.whole))
        self.tree = Tree(list(spec.tree)) if spec.wrists else self.whole
        self.spanning = Tree(list(spec.spanning)) if spec.wrists else self.whole
        self.bodies, self._whole_bodies = np.array(spec.tree_body), np.array(spec.bodies)
        self.welds = self._welds()
        self.q_of = indices(self.whole.q_slices[i] for i in spec.in_whole)
        self.v_of = indices(self.whole.v_slices[i] for i in spec.in_whole)
        self.q_in, self.v_in = _places(self.q_of, self.whole.nq), _places(self.v_of, self.whole.nv)
        self.q_from, self.v_from = _kept(self.q_of, self.tree.nq), _kept(self.v_of, self.tree.nv)
        self.q_to, self.v_to = self.q_of[self.q_from], self.v_of[self.v_from]

    def _welds(self) -> tuple[TreeClosure, ...]:
        """Return the welds of the whole tree's branches."""
        welds = []
        for wrist in self._spec.wrists:
            end, target = self._spec.in_whole[wrist.joints[-1]] + 1, self.tree_body(wrist.target)
            at = (end, np.eye(3), np.zeros(3), target, wrist.R, wrist.p)
            welds.append(TreeClosure("", "", *at, (0, 1, 2), "fixed"))
        return tuple(welds)

    def coordinates(
        self, q: Array, v: Array | None, a: Array | None, motion: Motion
    ) -> tuple[Array, Array, Array]:
        """Convert coordinates of the spanning tree to coordinates of the whole tree.

        Args:
            q: Positions of the spanning tree, shape (T, nq).
            v: Rates, shape (T, nv), or None for zero.
            a: Accelerations, shape (T, nv), or None for zero.
            motion: Motion of the spanning tree.

        Returns:
            Positions z, rates and accelerations of the whole tree: shapes (T, its nq), (T, its nv), twice.
        """
        out_q, (out_v, out_a) = np.empty((len(q), self.whole.nq)), np.zeros((2, len(q), self.whole.nv))
        out_q[:, self.q_of] = q
        for out, x in ((out_v, v), (out_a, a)):
            if x is not None:
                out[:, self.v_of] = x
        for joint in self._spec.platforms:
            at, to = self.tree.q_slices[joint], self.tree.v_slices[joint]
            platform = motion.of_body(self.bodies[joint + 1])
            out_q[:, at] = np.concatenate([platform.p, quaternion_from_rotation(platform.R)], axis=1)
            if v is not None:
                out_v[:, to] = platform.twist()
            if a is not None:
                out_a[:, to] = platform.acceleration()
        return out_q, out_v, out_a

    def positions(self, q: Array) -> Array:
        """Convert positions of the spanning tree, shape (T, nq), to those of `tree`, shape (T, its nq)."""
        return self.coordinates(q, None, None, self.spanning.sweep(q))[0][:, : self.tree.nq]

    def motion(self, spanning: Motion, z: Array) -> Motion:
        """Select the motion of the bodies of the whole tree from that of the spanning tree.

        Args:
            spanning: Motion of the spanning tree.
            z: Positions of the whole tree, shape (T, its nq).
        """
        if not self._spec.wrists:
            return spanning._replace(q=z)
        return Motion(*(select(part, self._whole_bodies) for part in spanning.arrays))._replace(q=z)

    def of_tree(self, whole: Motion) -> Motion:
        """Return the motion of `tree`, whose bodies come first in the whole tree; arrays are shared."""
        assert whole.q is not None
        own = Motion(*(part[:, : len(self.bodies)] for part in whole.arrays))
        return own._replace(q=whole.q[:, : self.tree.nq])

    def to_spanning(self, x: Array) -> Array:
        """Copy rates (or accelerations) from the whole tree, or from `tree`, to the spanning tree.

        Args:
            x: Rates of the whole tree or of `tree`, shape (T, its nv) or, of many columns, (T, its nv, k).

        Returns:
            Rates of the spanning tree, shape (T, nv) or (T, nv, k); zero for wrists if `x` is of `tree`.
        """
        if x.shape[1] == self.whole.nv:
            return x[:, self.v_of]
        out = np.zeros((len(x), self.spanning.nv, *x.shape[2:]))
        out[:, self.v_from] = x[:, self.v_to]
        return out

    def with_still_wrists(self, x: Array) -> Array:
        """Append zeros for the wrists' freedoms to rates of `tree`, shape (T, its nv)."""
        return np.concatenate([x, np.zeros((len(x), self.whole.nv - self.tree.nv))], axis=1)

    def to_tree(self, x: Array) -> Array:
        """Copy rates (or accelerations, or efforts) of the legs from the spanning tree to `tree`.

        Args:
            x: Rates of the spanning tree, shape (T, nv) or, of many columns, (T, nv, k).

        Returns:
            Rates of `tree`, zero for platforms, shape (T, its nv) or (T, its nv, k).
        """
        out = np.zeros((len(x), self.tree.nv, *x.shape[2:]))
        out[:, self.v_to] = x[:, self.v_from]
        return out

    def positions_to_spanning(self, x: Array, out: Array) -> None:
        """Copy positions of the legs from `tree`, shape (T, its nq), to the spanning tree, in place."""
        out[:, self.q_from] = x[:, self.q_to]

    def tree_body(self, body: int) -> int:
        """Return the number in `tree` of a body of the spanning tree; a wrist's end maps to its target."""
        for wrist in self._spec.wrists:
            if wrist.end == body:
                body = wrist.target
        return int(np.flatnonzero(self.bodies == body)[0])

    def whole_body(self, body: int) -> int:
        """Return the number in the whole tree of a body of the spanning tree."""
        return int(np.flatnonzero(self._whole_bodies == body)[0])

    def place(self, body: int) -> tuple[int, Array, Array] | None:
        """Return where a body of the spanning tree is in `tree`; None for a link between a wrist's joints.

        Returns:
            The body of `tree` that it is part of, and its placement there, R (3, 3) and p (3,).
        """
        ends = (wrist for wrist in self._spec.wrists if wrist.end == body and not wrist.carries)
        if (wrist := next(ends, None)) is not None:
            return self.tree_body(wrist.target), wrist.R, wrist.p
        return (self.tree_body(body), np.eye(3), np.zeros(3)) if body in self.bodies else None


def _places(of: Index, count: int) -> Index:
    """Return where each number below a count stands among some numbers, or -1, shape (count,)."""
    out = np.full(count, -1)
    out[of] = np.arange(len(of))
    return out


def _kept(of: Index, count: int) -> Index:
    """Return which entries are below a count."""
    return np.flatnonzero(of < count)
