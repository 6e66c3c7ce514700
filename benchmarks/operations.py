"""Count the operations of a program for one sample."""

from __future__ import annotations

from collections import Counter
from functools import reduce

import casadi as ca

from hybridyn.compiled.code.graph import Graph, Node
from hybridyn.compiled.code.quotients import operations_of
from hybridyn.compiled.program import Add, Call, Program
from hybridyn.compiled.programs.interpreter import run

#: Kinds of operations: sums and differences; products; quotients; square roots; sines and cosines; others.
KINDS = ("add", "mul", "div", "sqrt", "trig", "other")

#: Operations that cost nothing.
FREE = ("input", "constant", "neg")

_KIND = {"add": "add", "sub": "add", "mul": "mul", "div": "div", "sqrt": "sqrt", "sin": "trig", "cos": "trig"}


def costing(graph: Graph) -> list[Node]:
    """Return the operations that are computed at run time."""
    constant = [node.name == "constant" for node in graph.nodes]
    return [
        node
        for node in graph.nodes
        if node.name not in FREE
        and not (node.name == "div" and all(constant[abs(x) - 1] for x in node.arguments))
    ]


def operations(program: Program) -> dict[str, dict[str, int]]:
    """Count operations by part (`Kernel.part`) and kind, over all calls and copies.

    Returns:
        For each part, in the order of the calls, the number of operations of each kind.
    """
    each = [
        Counter(_KIND.get(node.name, "other") for node in costing(operations_of(kernel.function)))
        for kernel in program.kernels
    ]
    out: dict[str, Counter[str]] = {}
    for step in program.steps:
        if isinstance(step, Call):
            total = out.setdefault(program.kernels[step.kernel].part, Counter())
            for kind, number in each[step.kernel].items():
                total[kind] += number * step.copies
            total["add"] += step.copies * sum(t.size for t in step.targets if isinstance(t, Add))
    return {part: {kind: total[kind] for kind in KINDS} for part, total in out.items()}


def total(program: Program, without: str = "") -> int:
    """Count all operations of a program, without those of a part."""
    return sum(sum(kinds.values()) for part, kinds in operations(program).items() if part != without)


def flattened(program: Program) -> tuple[int, int]:
    """Count the operations of a program written as one expression, with common terms computed once.

    Args:
        program: The program.

    Returns:
        The number of operations with the guard and without it.
    """
    symbols = [ca.SX.sym(name, size) for name, size in program.inputs]
    result, guards = run(program, [x for column in symbols for x in ca.vertsplit(column)])
    outputs = [ca.vertcat(*result), reduce(ca.fmax, guards)]
    both = (ca.Function("flat", symbols, ca.cse(wanted)) for wanted in (outputs, outputs[:-1]))
    with_guard, alone = (len(costing(operations_of(f))) for f in both)
    return with_guard, alone
