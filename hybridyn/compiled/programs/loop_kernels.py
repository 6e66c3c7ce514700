"""The loops of modules of one shape, for which a kernel is written: its rows, and what follows from them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca

from ...errors import SingularityError
from ...spatial import Array, Mask
from ...structure.module import Module
from ...structure.module_spec import ModuleSpec
from ...symbols import Expression
from ..equations.arguments import ChosenNumbers
from ..equations.expressions import Folding
from ..equations.guarded_elimination import Pivots
from ..equations.idle.least import cut_weights, idle_freedoms
from ..equations.request import Request
from ..loops.engine import Loops
from ..loops.loop_rows import LoopRows, dependent_pivots, generic_rows, shape_of, spanning_closures
from .writer import alike

#: Function and table of numbers of a kernel.
Kernel = tuple[ca.Function, Array]


class LoopKernel:
    """The loops of modules of one shape, for which a kernel is written.

    Attributes:
        modules: The modules.
        given: Freedoms that stay independent if they can; others may, too.
        specs: The modules' numbers where some are arguments, or nothing.
        m: Mechanism of the first module.
        folding: Collects the numbers in which they differ.
        loops: Closes the loops over their spanning tree.
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
        self._looped = bool(self.m.spanning_closures.rows)
        tree, pivots, idle = self.m.spanning, Pivots((), (), ()), dict[int, Mask | None]()
        if self._looped:
            pivots = dependent_pivots(modules, generic_rows(modules), given)
            left = [c for c in range(tree.nv) if c not in pivots.cols and c not in given]
            idle |= idle_freedoms(modules, left) if follows and left else {}
        if specs:  # arguments may move a rod's end off its line
            idle = dict.fromkeys(idle)
        self.loops = Loops(tree, pivots, self.m.spanning_col_scale, cut_weights(self.m), idle)

    def check_independent(self, what: str, why: str) -> None:
        """Check that what is given is independent.

        Raises:
            SingularityError: It is not; the words are `why`, and `what` are the given joints.
        """
        if set(self.loops.dependent) & set(self.given):
            name = self.modules[0].name
            raise SingularityError(f"module '{name}': {why}", module=name, what=what)

    def rows(self, q: Expression, v: Expression | None = None) -> LoopRows:
        """Compute the rows at a posture, and at rates v."""
        folding = self.folding if self._looped else Folding()  # numbers of a tree without rows are not read
        return spanning_closures(self.modules, folding, q, self.specs, v)

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
