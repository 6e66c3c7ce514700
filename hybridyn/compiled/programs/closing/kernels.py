"""The kernels of modules of one shape: a Newton step, the rates at a closed posture, and the branch.

The unknowns are the positions z of an extended tree that are not given. With the rows K over its freedoms
(f: free, g: given) and the residual r,

    K_f step = -r
    K_f z_dot_f = wanted - K_g z_dot_g
    K_f z_ddot_f = wanted_dot - K_g z_ddot_g - K_dot z_dot

Rows of the tree after the cuts come first and do not depend on the wrists, so one elimination serves both.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property, reduce
from typing import Any

import casadi as ca
import numpy as np

from ....joints import displacement
from ....linkage.newton import LONGEST_STEP
from ....linkage.reduction import LegBlock
from ....spatial import Array, Index
from ....structure.module import Module
from ....symbols import Expression, dot, is_zero
from ...equations.arguments import ModuleArguments
from ...equations.expressions import Folding, pack, sampled, symbols, zeros
from ...equations.guarded_elimination import Pivots, choose_pivots
from ...equations.scales import GUARD_CLOSED, Scale, largest, squares, weighed
from ...equations.states import generic_positions, seen_postures
from ...loops.bounds import largest_solutions
from ...loops.engine import Loops, drift
from ..loop_kernels import Kernel
from .given import Given
from .rows import Places, TreeRows, rows_at
from .unknowns import Unknowns

#: Pivots smaller than the best by this factor may be chosen to keep the rows sparse.
SPARSE_CLOSING = 0.1
#: Rates above this multiple of the given ones are refused, as `assembly.task.BOUNDED` suspects them.
BOUNDED_RATES = 1e6


class ModuleKernels:
    """Writes the kernels of modules of one shape with the same given joints and targets."""

    def __init__(
        self,
        modules: Sequence[Module],
        given: Given,
        blocks: Sequence[LegBlock],
        arguments: Sequence[ModuleArguments | None] = (),
        places: tuple[Places, Places] = ({}, {}),
        idle: Sequence[int] = (),
        rank: int | None = None,
    ) -> None:
        """Collect the unknowns; pivots are chosen where they are first needed.

        Args:
            given: What is prescribed.
            blocks: Blocks of the free freedoms that do not depend on each other; none for one block.
            arguments: Arguments of each module, or None; nothing where no module has any.
            places: Frames of the robot's links, and the same as functions of the arguments.
            idle: Freedoms that stand for idle motions that nothing determines; their rates are the least.
            rank: Number of independent own rows over the free freedoms of the tree after the cuts; by default
                the number of these freedoms.
        """
        self.u, self.blocks = Unknowns(modules, given, arguments, places, idle), blocks
        self.e, self.rank = self.u.e, self.u.own if rank is None else rank
        self._folding, self._z = Folding(), symbols("z", self.e.tree.nq)

    @cached_property
    def loops(self) -> Loops:
        """Closes the loops: the first `rank` pivots are of the tree after the cuts, then those of wrists."""
        e = self.e
        return Loops(e.tree, self._pivots(), e.unit, e.weight, dict.fromkeys(self.u.idle))

    def _pivots(self) -> Pivots:
        """Choose pivots over the free freedoms."""
        u, folding = self.u, Folding()
        rows = rows_at(u.trees, u.given, folding, u.positions(0), u.targets(), u.places)
        columns, table = [*u.symbols("q_0", "p_0", "g"), folding.symbol()], folding.table(len(u.modules))
        each = zip(u.modules, table, strict=True)
        points = [(*x, own) for module, own in each for x in zip(*self._postures(module), strict=True)]
        K = sampled(rows.K, columns, points)[:, :, u.free]
        unit = self.e.unit[u.free]
        split = (slice(0, u.loops), slice(0, u.own)), (slice(u.loops, None), slice(u.own, None))
        ranks = self.rank, len(unit) - u.own
        first, second = (
            choose_pivots(K[:, r, c], rank, u.scale[r], unit[c], SPARSE_CLOSING)
            for rank, (r, c) in zip(ranks, split, strict=True)
        )
        cols = u.free[[*first.cols, *(c + u.own for c in second.cols)]]
        rows_of = first.rows + tuple(r + u.loops for r in second.rows)
        return Pivots(rows_of, tuple(cols.tolist()), first.sizes + second.sizes)

    def _postures(self, module: Module) -> tuple[Array, Array, Array]:
        """Return generic postures of a module: positions, platforms, and what is prescribed there."""
        m = module.mechanism
        cut, spanning = seen_postures(m), generic_positions(module)
        platforms = [cut[:, m.tree.q_slices[i]] for i in self.u.platforms]
        return (
            spanning,
            np.concatenate([np.zeros((len(cut), 0)), *platforms], axis=1),
            self.u.given.of_posture(m.tree, cut),
        )

    def write(self) -> dict[str, Kernel]:
        """Write the kernels; numbers that are arguments are expressions in the table.

        newton: From (q, p, g, numbers) to (q_next, p_next, step, wrist, open, guard).
        settle: From (q, p, q_1, p_1, g_0, g, g_dot, g_ddot, numbers) to (q_next, p_next, v, a, step, open,
            turning, guard): how far the Jacobian has turned from the start, (q_1, p_1, g_0), at most.
        branch: From (q_0, p_0, g_0, q_1, p_1, q_2, p_2, g, numbers) to (off, turned, guard).
        """
        return {"newton": self._newton(), "settle": self._settle(), "branch": self._branch()}

    def kernel(self, name: str, inputs: Sequence[ca.SX], outputs: Sequence[Any]) -> Kernel:
        """Return a kernel of what is computed at positions z, those of the first posture."""
        found = ca.substitute([ca.SX(x) for x in outputs], [self._z[0]], [pack(self.u.positions(0))])
        function = ca.Function(name, [*inputs, self._folding.symbol()], found)
        return function, self._folding.table(len(self.u.modules))

    @cached_property
    def _here(self) -> TreeRows:
        """The rows at positions z, and at rates of all freedoms."""
        return self._rows(self._z[1], self.u.rates[1])

    def _rows(self, z: Expression, v: Expression | None = None, *, exact: bool = False) -> TreeRows:
        """Write the rows with arguments at positions of the joints and rates v; `exact` as in `rows_at`."""
        trees, places = self.u.with_arguments, self.u.places_with_arguments
        return rows_at(trees, self.u.given, self._folding, z, self.u.targets(), places, v, exact=exact)

    def _drift(self, v: Expression) -> Expression:
        """Compute K_dot v at positions z, shape (rows,)."""
        return drift(self.e.tree, self._here, self._z[0], self.u.rates[0], v)

    def _guard(self, doubts: Expression, rows: TreeRows) -> Any:
        """Return the guard of pivots and of axes that must not point the wrong way."""
        wrong = (ca.if_else(cosine > 0.0, 0.0, 2.0) for cosine in rows.upright)
        return reduce(ca.fmax, wrong, squares(doubts))

    def _sizes(self, step: Expression) -> tuple[ca.SX, ca.SX]:
        """Return the size of a step of the tree after the cuts and of the wrists, without units."""
        size = step[self.u.free] / self.e.unit[self.u.free]
        return ca.SX(largest(size[: self.u.own])), ca.SX(largest(size[self.u.own :]))

    def _newton(self) -> Kernel:
        """Return the kernel of a Newton step, no longer than `LONGEST_STEP`."""
        rows = self._here
        step, _, doubts = self.loops.solved(rows.K, -rows.residual[:, None])
        size, wrist = self._sizes(step[:, 0])
        factor = ca.fmin(1.0, LONGEST_STEP / ca.fmax(ca.fmax(size, wrist), 1e-300))
        limited = np.array([0.0 if is_zero(x) else factor * x for x in step[:, 0]], dtype=object)
        moved = self.loops.moved(self._z[1], limited)
        own = (rows.residual * self.u.scale)[: self.u.loops]
        far = sum((x * x for x in own if not is_zero(x)), ca.SX(0.0))
        outputs = [*self.u.outside(moved), size, wrist, far, squares(doubts)]
        return self.kernel("newton", self.u.symbols("q_0", "p_0", "g"), outputs)

    def _settle(self) -> Kernel:
        """Return the kernel of a last step and of the rates before it."""
        rows, given, tree = self._here, self.u.given.columns(self.e.tree), self.e.tree
        rate, acceleration = zeros(tree.nv), zeros(tree.nv)
        g_dot, g_ddot = self.u.of("g_dot"), self.u.of("g_ddot")
        rate[given], acceleration[given] = g_dot[: len(given)], g_ddot[: len(given)]
        wanted = self._wanted(rows, g_dot[len(given) :])
        step, rate, doubts = self.loops.step(rows, rate, wanted)
        wanted_dot, drift = self._wanted(rows, g_ddot[len(given) :]), self._drift(rate)
        acceleration = self.loops.accelerations(rows, acceleration, drift, wanted_dot)
        guard = ca.fmax(self._guard(doubts, rows), self._bounded(rate, given, wanted))
        left = dot(rows.K, rate) - wanted, dot(rows.K, acceleration) - (wanted_dot - drift)
        outputs = [
            *self.u.outside(self.loops.moved(self._z[1], step)),
            self.u.rates_outside(rate),
            self.u.rates_outside(acceleration),
            ca.fmax(*self._sizes(step)),
            largest(rows.residual * self.u.scale),
            self._turning(rows.K, self._rows(self.u.positions(1, "g_0")).K),
            ca.fmax(guard, self._kept(left, (rate, acceleration))),
        ]
        names = ("q_0", "p_0", "q_1", "p_1", "g_0", "g", "g_dot", "g_ddot")
        return self.kernel("settle", self.u.symbols(*names), outputs)

    def _wanted(self, rows: TreeRows, targets: Expression) -> Expression:
        """Return the prescribed rates (or accelerations) of all rows, shape (rows,)."""
        turned = [
            dot(A.T, targets[at : at + 3]) for i, A in enumerate(rows.frames) for at in (6 * i, 6 * i + 3)
        ]
        coordinates = targets[6 * len(rows.frames) :]
        before = zeros(self.u.loops - 6 * len(rows.frames) - len(coordinates))
        return np.concatenate([before, *turned, coordinates, zeros(len(rows.residual) - self.u.loops)])

    def _bounded(self, rate: Expression, given: Index, wanted: Expression) -> ca.SX:
        """Return a guard above 1 where rates exceed `BOUNDED_RATES` times the given ones."""
        asked = ca.fmax(largest(rate[given] / self.e.unit[given]), largest(wanted * self.u.scale))
        fast = largest(rate[self.u.free] / self.e.unit[self.u.free])
        return ca.SX(ca.if_else(fast <= BOUNDED_RATES * asked, 0.0, 2.0))

    def _kept(self, left: tuple[Expression, Expression], motion: tuple[Expression, Expression]) -> Any:
        """Return the guard of redundant rows of the loops: what rates and accelerations leave of them.

        Where arguments may move a rod's end off its line, it looks at all rows.
        """
        moved = bool(self.u.idle) and self.u.with_arguments != self.u.trees
        rest = [i for i in range(self.u.loops) if moved or i not in self.loops.pivots.rows]
        rate, acceleration = (largest(x / self.e.unit) for x in motion)
        guard, scale = ca.SX(0.0), Scale(1.0, GUARD_CLOSED["float64"])
        for miss, size in zip(left, (rate, acceleration + rate * rate), strict=True):
            guard = guard + weighed([((miss * self.u.scale)[rest], 1.0)], scale.weight(size))
        return guard

    def _branch(self) -> Kernel:
        """Return the kernel that compares a step with its prediction, see `assembly.walk`.

        The first posture is the start, the second the predicted one, the third the one that was found.
        """
        predicted, found = self.u.positions(1), self.u.positions(2)
        here, there = (self._rows(z) for z in (self.u.positions(0, "g_0"), found))
        off = self.e.tree.by_joint(displacement.chord, [predicted, found], [])
        own = self.u.free[: self.u.own]
        turned, doubts = self._own_loops.turned(here.K, there.K, own.tolist())
        far = largest(off[own] / self.e.unit[own])
        outputs = [ca.SX(far), self._largest_block(turned[own]), ca.SX(squares(doubts))]
        names = ("q_0", "p_0", "g_0", "q_1", "p_1", "q_2", "p_2", "g")
        return self.kernel("branch", self.u.symbols(*names), outputs)

    @property
    def _own_loops(self) -> Loops:
        """The loops of the tree after the cuts."""
        return self.loops.first(self.rank)

    def _turning(self, K: Expression, K_start: Expression) -> ca.SX:
        """Bound what "branch" computes, with J here in the place of J at the start: |J^-1 (J - J_start)|.

        Each row of J^-1 (J - J_start) is at most as long as the sum of its absolute entries.
        """
        own = self.u.free[: self.u.own]
        change = (K - K_start)[:, own] * self.e.unit[own]
        size = np.array([sum((ca.fabs(x) for x in row if not is_zero(x)), 0.0) for row in change])
        bounds = largest_solutions(K, size, self._own_loops.pivots)[own] / self.e.unit[own]
        return self._largest_block(np.diag(bounds))

    def _largest_block(self, X: Expression) -> ca.SX:
        """Return the largest Frobenius norm of the blocks of X, which bounds their 2-norm."""
        own = self.u.free[: self.u.own].tolist()
        blocks = [[own.index(k) for k in block.cols.tolist()] for block in self.blocks] or [
            list(range(len(own)))
        ]
        norms = (squares(X[np.ix_(block, block)]) for block in blocks)
        return ca.sqrt(reduce(ca.fmax, norms, ca.SX(0.0)))
