"""The two trees of a module, the maps between them, and the motion of the wrists that were cut."""

from dataclasses import replace

import numpy as np

from ..errors import warn
from ..linkage.elimination import least_squares
from ..linkage.joints import TreeJoint
from ..linkage.tree import Motion, Tree
from ..spatial import Array, Index, Mask, cross, indices, quaternion_from_rotation, select, to_body_axes
from .module_spec import ModuleSpec
from .wrists import Wrist


class Cut:
    """The spanning tree of a module, its tree after the cuts, and the maps between their coordinates.

    Attributes:
        spanning: Tree of every joint of the module, wrists included, as in the user's q, v, a.
        tree: Tree after the cuts: joints of the legs, and platforms as `floating` joints from the base.
        bodies: For each body of `tree`, its number in `spanning`, shape (bodies,).
        q_from, v_from: Coordinates and freedoms of `spanning` that `tree` has, too.
        q_to, v_to: The same in `tree`.
    """

    def __init__(self, spec: ModuleSpec) -> None:
        self.spanning, self.tree = Tree(list(spec.spanning)), Tree(list(spec.tree))
        self.bodies = np.array(spec.tree_body)
        self._spec = spec
        joints = {i: source for i, source in enumerate(spec.tree_joint) if source is not None}
        self.q_from = indices(self.spanning.q_slices[source] for source in joints.values())
        self.v_from = indices(self.spanning.v_slices[source] for source in joints.values())
        self.q_to = indices(self.tree.q_slices[i] for i in joints)
        self.v_to = indices(self.tree.v_slices[i] for i in joints)

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
        out_q = np.zeros((len(q), self.tree.nq))
        out_q[:, self.q_to] = q[:, self.q_from]
        out_v, out_a = (
            self.to_tree(np.zeros((len(q), self.spanning.nv)) if x is None else x) for x in (v, a)
        )
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
        return self.coordinates(q, None, None, self.spanning.sweep(q))[0]

    def motion(self, spanning: Motion, x: Array) -> Motion:
        """Select the motion of the bodies of `tree` from that of the spanning tree.

        Args:
            spanning: Motion of the spanning tree.
            x: Positions of `tree`, shape (T, its nq).
        """
        return Motion(*(select(part, self.bodies) for part in spanning.arrays))._replace(q=x)

    def to_spanning(self, x: Array) -> Array:
        """Copy rates (or accelerations) of the legs from `tree` to the spanning tree; wrists have zeros.

        Args:
            x: Rates of `tree`, shape (T, its nv) or, of many columns, (T, its nv, k).

        Returns:
            Rates of the spanning tree, shape (T, nv) or (T, nv, k).
        """
        out = np.zeros((len(x), self.spanning.nv, *x.shape[2:]))
        out[:, self.v_from] = x[:, self.v_to]
        return out

    def to_tree(self, x: Array) -> Array:
        """Copy rates (or accelerations, or efforts) of the legs from the spanning tree to `tree`.

        Args:
            x: Rates of the spanning tree, shape (T, nv).

        Returns:
            Rates of `tree`, zero for platforms, shape (T, its nv).
        """
        out = np.zeros((len(x), self.tree.nv))
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

    def place(self, body: int) -> tuple[int, Array, Array] | None:
        """Return where a body of the spanning tree is in `tree`; None for a link between a wrist's joints.

        Returns:
            The body of `tree` that it is part of, and its placement there, R (3, 3) and p (3,).
        """
        ends = (wrist for wrist in self._spec.wrists if wrist.end == body and not wrist.carries)
        if (wrist := next(ends, None)) is not None:
            return self.tree_body(wrist.target), wrist.R, wrist.p
        return (self.tree_body(body), np.eye(3), np.zeros(3)) if body in self.bodies else None


#: A wrist whose reciprocal condition falls below this is in gimbal lock.
GIMBAL_LOCK = 1e-9
#: A wrist that carries a platform is near gimbal lock if the determinant of its axes is smaller than this.
#: Its joint rates, from which the rates of the platform are computed, grow with the reciprocal.
NEAR_LOCK = 1e-2


class WristMotion:
    """Motion of the cut wrists of one module; wrists are given by number.

    Attributes:
        specs: Numbers of each wrist.
    """

    def __init__(self, specs: tuple[Wrist, ...], cut: Cut, length: float, col_scale: Array) -> None:
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
        return indices(self._cut.spanning.q_slices[i] for i in self.specs[wrist].joints)

    def columns(self, wrist: int) -> Index:
        """Return the indices of a wrist's freedoms in the spanning tree."""
        return indices(self._cut.spanning.v_slices[i] for i in self.specs[wrist].joints)

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
        tree, spanning_tree = self._cut.tree, self._cut.spanning
        number = next(i for i, w in enumerate(self.specs) if body - 1 in w.joints)
        rates = self.rates_of(spanning, motion, number, np.eye(tree.nv))
        parent = self._cut.tree_body(spanning_tree.joints[self.specs[number].joints[0]].parent)
        here = spanning.p[:, body]
        own = spanning_tree.jacobian(spanning, body, here)[:, :, self.columns(number)]
        J = tree.jacobian(motion, parent, here) + np.matmul(own, rates)
        return to_body_axes(spanning.R[:, body], J)

    def rates_of(self, spanning: Motion, motion: Motion, wrist: int, X: Array) -> Array:
        """Compute the least-norm joint rates with which a wrist follows the bodies that it connects.

        The linear map of `recover`, for many motions of one posture.

        Args:
            spanning: Motion of the spanning tree.
            motion: Motion of the tree after the cuts.
            wrist: Number of the wrist.
            X: Columns of rates of the tree after the cuts, shape (T, n, k) or (n, k).

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

    def recover(self, q: Array, v: Array, a: Array | None, target: Motion, at: Motion | None = None) -> None:
        """Compute, in place, the least-norm rates (accelerations) of wrists whose ends follow their targets.

        Args:
            q: Positions of the spanning tree, shape (T, nq).
            v: Rates of the spanning tree, shape (T, nv); if `a` is None, those of the wrists are overwritten.
            a: Accelerations of the spanning tree, shape (T, nv); those of the wrists are overwritten.
            target: Motion of the tree after the cuts, with rates (or accelerations).
            at: A known motion of the spanning tree at the same positions, or None.
        """
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
    there, here = target.of_body(body), motion.of_body(end)
    r, w = here.p - there.p, there.w
    if not accelerations:
        return np.concatenate([there.p_dot + cross(w, r) - here.p_dot, w - here.w], axis=-1)
    linear = there.p_ddot + cross(there.w_dot, r) + cross(w, cross(w, r)) - here.p_ddot
    return np.concatenate([linear, there.w_dot - here.w_dot], axis=-1)


def is_locked(S: Array) -> Mask:
    """Check at which samples a wrist is in gimbal lock.

    Args:
        S: Joint columns of the wrist, as `WristMotion.jacobian` computes them, shape (T, 6, joints).

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
