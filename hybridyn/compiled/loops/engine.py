"""The engine that closes loops: a Newton step, rates, accelerations, and how far the rows turn.

A freedom of a tree is dependent if it has a pivot. The others are given, or stand for idle motions. With the
rows K (d: dependent, i: others), their residual r and what their rates should be,

    K_d step = -r      K_d v_d = wanted - K_i v_i      K_d a_d = wanted_dot - K_i a_i - K_dot v

Rods between two balls have idle motions. Step, rates and accelerations are orthogonal to these:
they are the least, as `assembly.assemble` has them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from ...joints import displacement
from ...linkage.tree import Tree
from ...spatial import Array, Mask
from ...symbols import Expression, dot, minus
from ..equations.expressions import pack, unpack, zeros
from ..equations.guarded_elimination import Pivots, Triangular, solve
from ..equations.idle.least import least_norm
from .loop_rows import LoopRows

#: Positions of a tree as a column of symbols, and as its entries.
Symbols = tuple[ca.SX, Expression]


@dataclass(frozen=True, eq=False)
class Loops:
    """The loops of modules of one shape.

    Attributes:
        tree: Their tree.
        pivots: Pivots of the dependent freedoms, of all freedoms of the tree.
        unit: Unit of each freedom, shape (nv,).
        weight: Weight of each freedom in the least norm, shape (nv,).
        idle: Freedoms that stand for idle motions, each with a mask of all that moves with it, shape (nv,);
            None if any freedom may.
    """

    tree: Tree
    pivots: Pivots
    unit: Array
    weight: Array
    idle: Mapping[int, Mask | None]

    @property
    def dependent(self) -> list[int]:
        """The dependent freedoms, in the order of their pivots."""
        return list(self.pivots.cols)

    def independent(self, v: Expression) -> Expression:
        """Return independent rates, zero for the others and for those that stand for idle motions."""
        out = v.copy()
        out[[*self.dependent, *self.idle]] = 0.0
        return out

    def solved(
        self, K: Expression, right: Expression, free: Sequence[int] = (), factors: Triangular | None = None
    ) -> tuple[Expression, Expression, Expression]:
        """Solve K x = right for the dependent freedoms, with the least of what is idle.

        Args:
            K: Shape (rows, nv).
            right: Shape (rows, k).
            free: Other freedoms, of which the motions are wanted.
            factors: Those of the rows and columns with pivots, where they are known.

        Returns:
            Solutions, zero for freedoms that are given, shape (nv, k); motions of all freedoms over those
            that are free, shape (nv, free); and the doubts of the pivots (`guarded_elimination.solve`).
        """
        k = right.shape[1]
        X, doubts = solve(K, right, self.pivots, [*free, *self.idle], factors)
        found = X[:, : k + len(free)]
        least_norm(found, self._masked(X[:, k + len(free) :]), self.weight)
        return found[:, :k], found[:, k:], doubts

    def idle_share(self, K: Expression, rates: Expression) -> Expression:
        """Return what rates have of idle motions, shape (nv,): steps, rates and accelerations lack it."""
        if not self.idle:
            return zeros(len(rates))
        idle = self._masked(solve(K, zeros(len(K), 0), self.pivots, [*self.idle])[0])
        rest = rates[:, None].copy()
        least_norm(rest, idle, self.weight)
        out: Expression = minus(rates, rest[:, 0])
        return out

    def _masked(self, idle: Expression) -> Expression:
        """Return idle motions with what they do not move set to zero, in place."""
        for motion, moved in zip(idle.T, self.idle.values(), strict=True):
            if moved is not None:
                motion[~moved] = 0.0
        return idle

    def step(
        self, rows: LoopRows, v: Expression, wanted: Expression | None = None
    ) -> tuple[Expression, Expression, Expression]:
        """Compute a Newton step, shape (nv,), and the rates of all freedoms, shape (nv,).

        Args:
            rows: The rows at a posture.
            v: Rates of the independent freedoms, zero for the others.
            wanted: What the rows' rates should be, shape (rows,); zero by default.

        Returns:
            Both, and the doubts of the pivots.
        """
        wanted = zeros(len(rows.K)) if wanted is None else wanted
        right = np.stack([-rows.residual, wanted - dot(rows.K, v)], axis=1)
        found, _, doubts = self.solved(rows.K, right)
        return found[:, 0], v + found[:, 1], doubts

    def accelerations(
        self, rows: LoopRows, a: Expression, drift: Expression, wanted: Expression | None = None
    ) -> Expression:
        """Compute the accelerations of all freedoms, shape (nv,).

        Args:
            rows: The rows at a posture.
            a: Accelerations of the independent freedoms, zero for the others.
            drift: K_dot v, shape (rows,).
            wanted: What the rows' rates should change by, shape (rows,); zero by default.
        """
        wanted = zeros(len(rows.K)) if wanted is None else wanted
        right = wanted - dot(rows.K, a) - drift
        return a + self.solved(rows.K, right[:, None])[0][:, 0]

    def moved(self, q: Expression, step: Expression) -> Expression:
        """Return positions after a step."""
        return self.tree.by_joint(displacement.moved, [q], [step])

    def turned(
        self, K: Expression, there: Expression, cols: Sequence[int], factors: Triangular | None = None
    ) -> tuple[Expression, Expression]:
        """Compute J^-1 (J' - J) without units, J' those at another posture.

        Args:
            K, there: The rows at both, shape (rows, nv).
            cols: Freedoms over which they change.
            factors: As for `solved`.

        Returns:
            Shape (nv, cols), zero for freedoms that do not depend, and the doubts of the pivots.
        """
        change, doubts = solve(K, (there - K)[:, cols], self.pivots, (), factors)
        return change * self.unit[list(cols)] / self.unit[:, None], doubts

    def first(self, count: int) -> Loops:
        """Return the loops of which the first pivots are known."""
        return replace(self, pivots=self.pivots.first(count))


def drift(tree: Tree, rows: LoopRows, q: ca.SX, w: ca.SX, v: Expression) -> Expression:
    """Compute K_dot v, shape (rows,), from rows at symbols of positions q and of rates w."""
    rate = tree.by_joint(displacement.rate, [unpack(q)], [unpack(w)])
    changes = ca.jtimes(pack(rows.rates), q, pack(rate)) + pack(rows.drift)
    return unpack(ca.substitute(changes, w, pack(v)))
