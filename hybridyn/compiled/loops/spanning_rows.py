"""Residuals and rows of closures over the rates of a whole tree; they hold for open loops, too."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...linkage.closure_rows import directions_of, rows_of
from ...linkage.closures import Closures, TreeClosure
from ...linkage.tree import Tree
from ...spatial import cross, hat
from ...symbols import Expression, dot, minus
from ..equations.chains import columns_through, point_velocity
from ..equations.expressions import numbers


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

    def closure(self, c: TreeClosure) -> tuple[Expression, Expression]:
        """Compute a closure's residual, shape (rows,), and Jacobian, shape (rows, nv)."""
        own = Closures(self.tree, [c], [])
        assert self.motion.q is not None
        return own.residual(self.motion.q, self.motion)[0], own.matrix(self.motion)[0]

    def rates(self, c: TreeClosure) -> Expression:
        """Compute the rates of a closure's residual, its Jacobian times v, from the motion of its bodies.

        The product with the matrix has more operations, and so has its derivative. `Closures.rates`, which
        compares the bodies where each of them is, lets programs have up to 1.07 times as many.
        """
        R, p, w, p_dot = (x[0] for x in self.motion.arrays[:4])
        pb = p[c.body_b] + dot(R[c.body_b], c.p_b)
        a, b = (p_dot[body] + cross(w[body], pb - p[body]) for body in (c.body_a, c.body_b))
        A, z = dot(R[c.body_a], c.R_a), dot(R[c.body_b], c.R_b)[:, 2]
        directions = directions_of(c.translations, c.rotation, A, z)
        return rows_of(directions, ((b - a)[None], (w[c.body_b] - w[c.body_a])[None]))[:, 0]

    def on_rod(
        self, c: TreeClosure, turns: Sequence[int], on_line: bool, *, exact: bool = False
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
        residual, rows = self.closure(c)
        support, first = self.tree.support, min(turns, default=self.tree.nv)
        alone = np.flatnonzero(support[c.body_a] & ~support[c.body_b])
        own = self._through({self.tree.dof_body[k] for k in alone if k >= first})
        for k, column in own.items():
            rows[:, k] = -dot(c.R_a.T, point_velocity(column, c.p_a))
        if on_line:
            rows[2, list(turns)] = 0.0  # rounding
        for k, column in own.items() if exact else ():
            x, y, _ = dot(c.R_a.T, column[3:])
            off = cross(np.array([x, y, 0.0], dtype=object), residual)
            rows[:, k] = minus(rows[:, k], off)
        return residual, rows

    def drift(self, c: TreeClosure) -> Expression:
        """Compute the derivative of a ball's three rows times the tree's rates, which close it."""
        a, b = (self._acceleration(*at) for at in ((c.body_a, c.p_a), (c.body_b, c.p_b)))
        return dot(dot(self.motion.R[0, c.body_a], c.R_a).T, b - a)

    def _acceleration(self, body: int, point: Expression) -> Expression:
        """Compute the acceleration of a body's point, shape (3,), base axes."""
        R, _, w, _, w_dot, p_ddot = (x[0, body] for x in self.motion.arrays)
        out: Expression = p_ddot + dot(hat(w_dot) + dot(hat(w), hat(w)), dot(R, point))
        return out

    def own_columns(self, body: int) -> dict[int, Expression]:
        """Return the twist of a body, in its own frame, at a unit rate of each freedom that carries it."""
        return self._through({*self.tree.dof_body[self.tree.support[body]].tolist()})

    def _through(self, bodies: set[int]) -> dict[int, Expression]:
        """Return the columns of the outermost of some bodies, each of which carries the next."""
        tree, (R, p) = self.tree, self.local
        joints = [body - 1 for body in sorted(bodies)]
        return columns_through(
            (R[0, i], p[0, i], numbers(tree.joints[i].S), tree.v_slices[i].start) for i in joints
        )
