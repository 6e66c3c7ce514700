"""The loops of modules of one shape, for which a kernel is written: its rows, and what follows from them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np

from ...errors import SingularityError
from ...spatial import Array, Mask
from ...structure.module import Module
from ...structure.module_spec import ModuleSpec
from ...symbols import Expression, dot, plus
from ..equations.arguments import ChosenNumbers
from ..equations.expressions import Folding
from ..equations.guarded_elimination import Pivots, solve
from ..equations.idle import cut_weights, idle_freedoms, least_norm
from ..equations.loops import LoopRows, dependent_pivots, generic_rows, shape_of, spanning_closures
from ..equations.request import Request
from .writer import alike

#: Function and table of numbers of a kernel.
Kernel = tuple[ca.Function, Array]


class LoopKernel:
    """The loops of modules of one shape, for which a kernel is written.

    Attributes:
        modules: The modules.
        given: Freedoms that stay independent if they can; others may, too.
        specs: The modules' numbers where some are arguments, or nothing.
        tree: Their spanning tree.
        folding: Collects the numbers in which they differ.
        pivots: Pivots of the dependent freedoms.
        dependent: These freedoms.
        idle: Independent freedoms that move nothing but what is idle, each with all that it moves.
    """

    def __init__(
        self,
        modules: list[Module],
        given: Sequence[int],
        specs: Sequence[ModuleSpec] = (),
        *,
        follows: bool = True,
    ) -> None:
        """Choose the dependent freedoms; `follows` tells whether idle motions are left to the least norm."""
        self.modules, self.given, self.specs = modules, given, specs
        self.m, self.folding = modules[0].mechanism, Folding()
        self.tree, self._looped = self.m.spanning, bool(self.m.spanning_closures.rows)
        self.pivots, self.idle = Pivots((), (), ()), dict[int, Mask]()
        if self._looped:
            K = generic_rows(modules)
            self.pivots = dependent_pivots(modules, K, given)
            left = [c for c in range(self.tree.nv) if c not in self.pivots.cols and c not in given]
            self.idle = idle_freedoms(modules, K, self.pivots, left) if follows and left else {}
        self.dependent = list(self.pivots.cols)

    def check_independent(self, what: str, why: str) -> None:
        """Check that what is given is independent.

        Raises:
            SingularityError: It is not; the words are `why`, and `what` are the given joints.
        """
        if set(self.dependent) & set(self.given):
            name = self.modules[0].name
            raise SingularityError(f"module '{name}': {why}", module=name, what=what)

    def rows(self, q: Expression, v: Expression | None = None) -> LoopRows:
        """Compute the rows at a posture, and at rates v."""
        folding = self.folding if self._looped else Folding()  # numbers of a tree without rows are not read
        return spanning_closures(self.modules, folding, q, self.specs, v)

    def step(self, rows: LoopRows, v: Expression) -> tuple[Expression, Expression, Expression]:
        """Compute a Newton step, and the rates that the independent ones of v cause, shapes (nv,)."""
        rates = self.independent(v)
        right = np.stack([-rows.residual, -dot(rows.K, rates)], axis=1)
        X, _, doubts = self.solved(rows, right, rates)
        return X[:, 0], X[:, 1], doubts

    def independent(self, v: Expression) -> Expression:
        """Return independent rates, zero for the others and for those that move nothing but what is idle."""
        out = v.copy()
        out[[*self.dependent, *self.idle]] = 0.0
        return out

    def solved(
        self, rows: LoopRows, right: Expression, known: Expression
    ) -> tuple[Expression, Expression, Expression]:
        """Solve K x = right for the dependent freedoms, with the least of what is idle.

        Args:
            right: Right-hand sides, shape (rows, k).
            known: Independent entries that are added to the last solution, shape (nv,).

        Returns:
            Solutions, shape (nv, k); motions over the independent freedoms, shape (nv, independent); and the
            doubts of the pivots.
        """
        k = right.shape[1]
        X, doubts = solve(rows.K, right, self.pivots)
        found, motions = X[:, :k], X[:, k:]
        found[:, -1] = plus(found[:, -1], known)
        if self.idle:
            free = [c for c in range(self.tree.nv) if c not in self.dependent]
            idle = motions[:, [free.index(c) for c in self.idle]]
            if not self.specs:  # arguments may move a rod's end off its line
                idle[~np.stack([*self.idle.values()], axis=1)] = 0.0
            least_norm(found, idle, cut_weights(self.m))
        return found, motions, doubts

    def kernel(self, name: str, inputs: list[ca.SX], outputs: list[Any]) -> Kernel:
        """Return the function of inputs and of numbers, and the table of these."""
        function = ca.Function(name, [*inputs, self.folding.symbol()], [*map(ca.SX, outputs)])
        return function, self.folding.table(len(self.modules))


def loop_kernels(
    request: Request, driven: set[int], among: Sequence[int] | None = None, *, follows: bool = True
) -> list[tuple[Any, list[int], LoopKernel]]:
    """Return the loops of the modules of each shape, with a key and the modules' numbers.

    Args:
        driven: Freedoms that are given.
        among: Numbers of the modules, by default all.
        follows: As for `LoopKernel`.
    """
    modules = request.robot.modules
    own = request.arguments.of_modules if isinstance(request.arguments, ChosenNumbers) else ()
    given = [tuple(k for k, column in enumerate(m.v_index.tolist()) if column in driven) for m in modules]
    specs = [m.mechanism.spec if x is None else x.spec for m, x in zip(modules, own, strict=False)]
    shapes = alike(range(len(modules)) if among is None else among, lambda k: shape_of(modules[k], given[k]))
    return [
        (
            shape,
            numbers,
            LoopKernel(
                [modules[k] for k in numbers],
                given[numbers[0]],
                [specs[k] for k in numbers if own],
                follows=follows,
            ),
        )
        for shape, numbers in shapes.items()
    ]
