"""Residuals and rows of closures over the rates of a whole tree; they hold for open loops, too."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...linkage.closures import TreeClosure, directions_of, residual_of, rows_of
from ...linkage.tree import Tree
from ...spatial import cross, motion_to_body
from ...symbols import Expression, dot, minus
from .chains import point_velocity
from .expressions import numbers

#: Frames of a closure on its bodies: axes and origin of A, axes and origin of B.
Frames = tuple[Expression, Expression, Expression, Expression]


class SpanningRows:
    """Residuals and Jacobian rows over the rates of a tree at one posture.

    Attributes:
        tree: The tree.
        motion: Its motion, one sample of symbols.
        local: Each child in its parent, shapes (1, joints, 3, 3), (1, joints, 3).
    """

    def __init__(self, tree: Tree, q: Expression, v: Expression | None) -> None:
        """Sweep the tree."""
        self.tree, self.local = tree, tree.local(q[None])
        self.motion = tree.sweep(q[None], None if v is None else v[None])
        self._columns = [x[0] for x in tree.columns(self.motion)]

    def closure(self, c: TreeClosure, frames: Frames) -> tuple[Expression, Expression]:
        """Compute a closure's residual, shape (rows,), and Jacobian, shape (rows, nv)."""
        (A, pa), (B, pb) = self._placed(c, frames)
        sign = self.tree.support[c.body_b].astype(float) - self.tree.support[c.body_a]
        linear, angular = (x * sign[:, None] for x in self._columns)
        at_b = linear + cross(angular, pb - self.motion.p[0, self.tree.dof_body])
        residual = residual_of(c.translations, c.rotation, (A, pa), (B, pb))
        return residual, rows_of(directions_of(c.translations, c.rotation, A, B[:, 2]), (at_b, angular))

    def rates(self, c: TreeClosure, frames: Frames) -> Expression:
        """Compute the rates of a closure's residual, its Jacobian times v, from the twists of its bodies.

        The product with the matrix has more operations, and so has its derivative.
        """
        (A, _), (B, pb) = self._placed(c, frames)
        p, w, p_dot = (x[0] for x in (self.motion.p, self.motion.w, self.motion.p_dot))
        a, b = (p_dot[body] + cross(w[body], pb - p[body]) for body in (c.body_a, c.body_b))
        directions = directions_of(c.translations, c.rotation, A, B[:, 2])
        return rows_of(directions, ((b - a)[None], (w[c.body_b] - w[c.body_a])[None]))[:, 0]

    def on_rod(
        self, c: TreeClosure, frames: Frames, turns: Sequence[int], on_line: bool, *, exact: bool = False
    ) -> tuple[Expression, Expression]:
        """Compute `closure` for a rod's end, A, in the rod's axes, with few operations.

        How the rod moves its own end does not depend on where the rod is. The end is taken at A, where the
        closure is once it is closed.

        Args:
            turns: Freedoms that turn the rod about a point of its line.
            on_line: Whether A is on this line; arguments may move it off.
            exact: Whether the rows are derivatives of the residual also where the closure is open, but for
                turns about the line.
        """
        residual, rows = self.closure(c, frames)
        support, first = self.tree.support, min(turns, default=self.tree.nv)
        alone = np.flatnonzero(support[c.body_a] & ~support[c.body_b])
        own = self._own_columns(c.body_a, {self.tree.dof_body[k] for k in alone if k >= first})
        for k, column in own.items():
            rows[:, k] = -dot(frames[0].T, point_velocity(column, frames[1]))
        if on_line:
            rows[2, list(turns)] = 0.0  # rounding
        for k, column in own.items() if exact else ():
            x, y, _ = dot(frames[0].T, column[3:])
            off = cross(np.array([x, y, 0.0], dtype=object), residual)
            rows[:, k] = minus(rows[:, k], off)
        return residual, rows

    def drift(self, c: TreeClosure, frames: Frames) -> Expression:
        """Compute the derivative of a closure's three rows times the tree's rates, which close it."""
        p, w, w_dot, p_ddot = (
            x[0] for x in (self.motion.p, self.motion.w, self.motion.w_dot, self.motion.p_ddot)
        )
        (A, pa), (_, pb) = self._placed(c, frames)
        ends = ((c.body_a, pa - p[c.body_a]), (c.body_b, pb - p[c.body_b]))
        a, b = (p_ddot[i] + cross(w_dot[i], r) + cross(w[i], cross(w[i], r)) for i, r in ends)
        return dot(A.T, b - a)

    def own_columns(self, body: int) -> dict[int, Expression]:
        """Return the twist of a body, in its own frame, at a unit rate of each freedom that carries it."""
        return self._own_columns(body, {*self.tree.dof_body[self.tree.support[body]].tolist()})

    def _own_columns(self, body: int, among: set[int]) -> dict[int, Expression]:
        """Return the columns of `own_columns` of joints that carry some bodies."""
        columns: dict[int, Expression] = {}
        for child in sorted(among):
            R, p = (x[0, child - 1] for x in self.local)
            columns = {k: motion_to_body(R, p, column) for k, column in columns.items()}
            at = self.tree.v_slices[child - 1]
            S = numbers(self.tree.joints[child - 1].S)
            columns |= {at.start + k: x for k, x in enumerate(S.T)}
        return columns

    def _placed(self, c: TreeClosure, frames: Frames) -> Sequence[tuple[Expression, Expression]]:
        """Compute axes and origins of frames A and B of a closure, in the base frame."""
        bodies = ((c.body_a, frames[:2]), (c.body_b, frames[2:]))
        R0, p0 = self.motion.R[0], self.motion.p[0]
        return [(dot(R0[body], R), p0[body] + dot(R0[body], p)) for body, (R, p) in bodies]
