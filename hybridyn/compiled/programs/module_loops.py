"""The loops of one module at a time: programs that read its numbers, for code that closes each by itself.

Modules do not depend on each other, so each walks along its own branch in as many parts as it needs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ...spatial import Array
from ..equations.arguments import ChosenNumbers
from ..equations.expressions import pack
from ..equations.request import Request
from ..equations.scales import GUARD_CLOSED
from ..program import Program, Worst
from .close import CLOSED, by_motors, freedoms_of, newton_step, turning
from .loop_kernels import Kernel, LoopKernel, loop_kernels
from .writer import Writer

#: Name and length of arrays.
Ends = list[tuple[str, int]]


@dataclass(frozen=True, eq=False)
class ModuleLoops:
    """Programs that close the loops of a module of one shape.

    Inputs end with "numbers", those of the module; the others are those of a robot of this module alone.

    Attributes:
        modules: Numbers of the modules in the robot.
        side: The given freedoms of each among its own, in ascending order.
        newton: One step of Newton's method, from what "close" reads to "q".
        close: As `close.close_program`.
        turning: As `close.turning_program`.
        numbers: The modules' numbers, shape (modules, n).
        of_parameters: Where some of them are arguments: for each module the program from the robot's
            "parameters" to its "numbers".
    """

    modules: tuple[int, ...]
    side: tuple[int, ...]
    newton: Program
    close: Program
    turning: Program
    numbers: Array
    of_parameters: tuple[Program, ...]

    @property
    def called(self) -> dict[str, Program]:
        """The programs that code of a module calls, by name; "numbers_k" are those of the k-th module."""
        numbers = {f"numbers_{k}": program for k, program in enumerate(self.of_parameters)}
        return {"newton": self.newton, "close": self.close, "turning": self.turning} | numbers


def module_loops(request: Request, side: Sequence[str]) -> list[ModuleLoops]:
    """Write the programs of the modules of each shape, of which some joints of one freedom are given."""
    driven = freedoms_of(request.robot, side)
    return [
        _of_shape(request, numbers, kernel)
        for _, numbers, kernel in loop_kernels(request, driven)
        if kernel.loops.tree.nv
    ]


def _of_shape(request: Request, modules: list[int], kernel: LoopKernel) -> ModuleLoops:
    """Write the programs of modules of one shape, whose rows share one table of numbers."""
    closed, tree = GUARD_CLOSED[request.dtype], kernel.loops.tree
    written = by_motors(kernel, closed), newton_step(kernel, closed), turning(kernel)
    table = written[0][1]
    q, v, own = tree.nq, tree.nv, ("numbers", table.shape[1])
    motion: Ends = [("near", q), ("v", v), ("a", v), own]
    ends: list[tuple[str, Ends, Ends]] = [
        ("close", motion, list(zip(CLOSED, (q, v, v), strict=True))),
        ("newton", motion, [("q", q)]),
        ("turning", [("near", q), ("q", q), own], []),
    ]
    close, newton, turned = (_alone(*of, one) for of, one in zip(ends, written, strict=True))
    chosen = request.arguments
    of_parameters = tuple[Program, ...]()
    if table.dtype == object and isinstance(chosen, ChosenNumbers):
        given: Ends = [("parameters", chosen.column.numel())]
        functions = (ca.Function("numbers", [chosen.column], [pack(row)]) for row in table)
        of_parameters = tuple(_alone("numbers", given, [own], (one, table[:1])) for one in functions)
    return ModuleLoops(tuple(modules), tuple(kernel.given), newton, close, turned, table, of_parameters)


def _alone(name: str, inputs: Ends, outputs: Ends, kernel: Kernel) -> Program:
    """Return the program of one kernel; outputs beyond those of the program are guards."""
    function, w = kernel[0], Writer(name, inputs, outputs)
    sources = [w.from_given(of, np.arange(size)) for of, size in inputs]
    results = [w.result(of, np.arange(size)) for of, size in outputs]
    guards = [Worst()] * (function.n_out() - len(outputs))
    w.call(w.kernel(name, function, "closures"), 1, sources, [*results, *guards])
    return w.program()
