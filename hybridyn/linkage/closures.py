"""Loop closures of a tree: residual, constraint rows K and drift term gamma of all of them.

K stacks the rows of all closures (`closure_rows`) and couplings of a tree: K q_dot = 0 and
K q_ddot + gamma = 0 on every motion that keeps the loops closed.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, field

import numpy as np

from ..joints.kinds import RotationKind
from ..spatial import (
    Array,
    Mask,
    added,
    compose,
    cross,
    multiplied,
    rotate,
    run,
    samples_inside,
    select,
    slices,
    subtracted,
)
from .closure_rows import TURNING, directions_of, drift_of, residual_of, rows_of, slides_of, turns_dot
from .couplings import CouplingRows, TreeCoupling
from .motion import Motion
from .tree import Tree


@dataclass(frozen=True, eq=False)
class TreeClosure:
    """A closure between two bodies of a tree (defined in `description.records.Closure`).

    Attributes:
        kind: Its kind as written in the file.
        body_a: Index of the predecessor body.
        R_a: Axes of frame A, shape (3, 3), frame of body A.
        p_a: Origin of frame A, shape (3,), [m], frame of body A.
        body_b: Index of the successor body.
        R_b: Axes of frame B, shape (3, 3), frame of body B.
        p_b: Origin of frame B, shape (3,), [m], frame of body B.
        translations: Axes of A along which B's origin is constrained.
        rotation: Kind of constraint on the relative rotation.
        turn: Axes of frame A in the author's frame, in which wrenches are reported, shape (3, 3).
    """

    name: str
    kind: str
    body_a: int
    R_a: Array
    p_a: Array
    body_b: int
    R_b: Array
    p_b: Array
    translations: tuple[int, ...]
    rotation: RotationKind
    turn: Array = field(default_factory=lambda: np.eye(3))

    @property
    def rows(self) -> int:
        """Number of constraint rows."""
        return len(self.translations) + len(range(3)[TURNING[self.rotation]])


class _Group:
    """Closures of the same form, evaluated as a batch: same rows, same number of freedoms involved."""

    def __init__(self, tree: Tree, closures: list[TreeClosure], first_rows: list[int]) -> None:
        first = closures[0]
        self.translations, self.rotation = first.translations, first.rotation
        a, b = [c.body_a for c in closures], [c.body_b for c in closures]
        self.bodies = run(np.array([*a, *b]))  # frames A, then frames B: one call of NumPy serves both
        placed = [(c.R_a, c.p_a) for c in closures] + [(c.R_b, c.p_b) for c in closures]
        columns = np.array([np.column_stack(frame).T for frame in placed])
        self.on_bodies = columns.swapaxes(0, 1).copy().transpose(1, 2, 0)  # columns outermost, samples inside
        self.of_a, self.of_b = slice(len(a)), slice(len(a), None)
        self.rows = np.array(first_rows)[:, None] + np.arange(first.rows)
        self.cols = np.array([np.flatnonzero(involved(tree, c)) for c in closures]).reshape(len(closures), -1)
        on_a, on_b = (tree.support[np.array(x)[:, None], self.cols].astype(float) for x in (a, b))
        self.sign = (on_b - on_a)[..., None, None]

    def moved_by(self, free: Mask) -> _Group:
        """Return the group restricted to some freedoms, if every closure involves the same number of them."""
        count = free[self.cols].sum(axis=1)
        out = copy(self)
        if (count == count[0]).all():
            chosen = free[self.cols]
            out.cols = self.cols[chosen].reshape(len(self.cols), -1)
            out.sign = self.sign[chosen].reshape(len(self.cols), -1, 1, 1)
        return out

    def frames(self, motion: Motion) -> tuple[Array, Array, Array, Array]:
        """Compute axes and origins of A, then of B, in the base: (T, g, 3, 3), (T, g, 3), twice."""
        axes, origins = self._placed(motion)
        return axes[:, self.of_a], origins[:, self.of_a], axes[:, self.of_b], origins[:, self.of_b]

    def _placed(self, motion: Motion) -> tuple[Array, Array]:
        """Compute axes and origins of the frames A, then of the frames B, (T, 2 g, 3, 3), (T, 2 g, 3)."""
        frames = compose(select(motion.R, self.bodies), self.on_bodies)
        return frames[..., :3], added(select(motion.p, self.bodies), frames[..., 3])

    def residual(self, motion: Motion) -> Array:
        """Compute the residuals, shape (T, g, rows): metres, then radians."""
        A, pa, B, pb = self.frames(motion)
        return residual_of(self.translations, self.rotation, (A, pa), (B, pb))

    def matrix(self, tree: Tree, motion: Motion, columns: Array) -> Array:
        """Compute the rows over the involved freedoms, shape (T, g, rows, involved)."""
        A, _, B, pb = self.frames(motion)
        own = multiplied(select(columns, self.cols), self.sign)
        linear, angular = own[..., 0], own[..., 1]
        origin = select(motion.p, tree.dof_body[self.cols])
        at_b = added(linear, cross(angular, subtracted(pb[:, :, None, :], origin)))
        return rows_of(directions_of(self.translations, self.rotation, A, B[..., 2]), (at_b, angular))

    def rates(self, motion: Motion) -> tuple[Array, Array]:
        """Compute the first two time derivatives of the residuals along the motion, shapes (T, g, rows)."""
        axes, p = self._placed(motion)
        w, w_dot, v, a = (
            select(x, self.bodies) for x in (motion.w, motion.w_dot, motion.p_dot, motion.p_ddot)
        )
        arm = p - select(motion.p, self.bodies)
        v, a = v + cross(w, arm), a + cross(w_dot, arm) + cross(w, cross(w, arm))
        r, v, a = (x[:, self.of_b] - x[:, self.of_a] for x in (p, v, a))
        A, B, wa, wb = (x[:, at] for x in (axes, w) for at in (self.of_a, self.of_b))
        wda, wdb = w_dot[:, self.of_a], w_dot[:, self.of_b]
        slide, slide_dot = slides_of(r, v, a, wa, wda)
        z, w = B[..., 2], wb - wa
        along = directions_of(self.translations, self.rotation, A, z)
        first = np.concatenate([rotate(along.axes, slide), rotate(along.turns, w)], axis=-1)
        return first, drift_of(along, turns_dot(self.rotation, A, z, wa, wb), slide_dot, w, wdb - wda)


def involved(tree: Tree, closure: TreeClosure) -> Mask:
    """Return the mask of freedoms that move frame B relative to frame A, shape (nv,)."""
    out: Mask = tree.support[closure.body_a] ^ tree.support[closure.body_b]
    return out


class Closures:
    """All closures and couplings of one tree, in the order given: first closure rows, then coupling rows.

    Attributes:
        closures: The closures.
        couplings: The couplings.
        row_slices: Row slice of each closure, then of each coupling.
        rows: Total number of rows.
        is_angle: Mask of the rows whose residual is an angle, shape (rows,).
    """

    def __init__(self, tree: Tree, closures: list[TreeClosure], couplings: list[TreeCoupling]) -> None:
        self.tree, self.closures, self.couplings = tree, tuple(closures), tuple(couplings)
        sizes = [c.rows for c in closures] + [1] * len(couplings)
        self.row_slices, self.rows = slices(sizes), sum(sizes)
        shapes: dict[tuple[object, ...], list[int]] = {}
        for i, c in enumerate(closures):
            key = (c.translations, c.rotation, int(involved(tree, c).sum()))
            shapes.setdefault(key, []).append(i)
        self._groups = [
            _Group(tree, [closures[i] for i in members], [self.row_slices[i].start for i in members])
            for members in shapes.values()
        ]
        self._coupled = CouplingRows(tree, couplings)
        self.is_angle = np.zeros(self.rows, dtype=bool)
        for c, at in zip(closures, self.row_slices, strict=False):
            self.is_angle[at.start + len(c.translations) : at.stop] = True

    def residual(self, q: Array, motion: Motion) -> Array:
        """Compute the closure residuals, shape (T, rows), [m, rad]."""
        out = np.zeros((len(q), self.rows), motion.p.dtype)
        for group in self._groups:
            out[:, group.rows] = group.residual(motion)
        if self.couplings:
            out[:, self.rows - len(self.couplings) :] = self._coupled.residual(q)
        return out

    def matrix(self, motion: Motion, scales: tuple[Array, Array] | None = None) -> Array:
        """Compute the constraint rows K over the tree's freedoms, shape (T, rows, nv).

        Args:
            motion: Motion of the tree (positions suffice).
            scales: Factor of each row and of each column, shapes (rows,) and (nv,); one by default.
        """
        K = samples_inside((len(motion.p), self.rows, self.tree.nv), motion.p.dtype)
        row_scale, col_scale = scales or (np.ones(self.rows), np.ones(self.tree.nv))
        columns = self.tree.columns(motion)
        by_row = K.transpose(1, 2, 0)
        for group in self._groups:
            rows = group.matrix(self.tree, motion, columns).transpose(1, 2, 3, 0)
            at, cols = group.rows[:, :, None], group.cols[:, None, :]
            by_row[at, cols] = multiplied(rows, (row_scale[at] * col_scale[cols])[..., None])
        if self.couplings:
            first = self.rows - len(self.couplings)
            K[:, first:] = self._coupled.matrix(motion.q) * row_scale[first:, None] * col_scale
        return K

    def moved_by(self, free: Mask) -> Closures:
        """Return the closures with a matrix filled in only for freedoms in the mask `free`, shape (nv,)."""
        out = copy(self)
        out._groups = [group.moved_by(free) for group in self._groups]
        out._coupled = self._coupled.moved_by(free)
        return out

    def rates(self, motion: Motion, v: Array, a: Array | None = None) -> tuple[Array, Array]:
        """Compute the first two time derivatives of the residual along a motion: K q_dot, K q_ddot + gamma.

        Args:
            motion: Motion of the tree. Swept at zero joint accelerations, the second is the drift term gamma.
            v: Joint rates, shape (T, nv).
            a: Joint accelerations that the motion was swept at, shape (T, nv); zero where left out.

        Returns:
            Each of shape (T, rows).
        """
        first, second = np.zeros((2, len(v), self.rows), motion.p.dtype)
        for group in self._groups:
            first[:, group.rows], second[:, group.rows] = group.rates(motion)
        if self.couplings:
            couplings = self.rows - len(self.couplings)
            first[:, couplings:], second[:, couplings:] = self._coupled.rates(motion.q, v, a)
        return first, second
