"""A kernel with the operations that its C has: one division per divisor, and signs moved outwards.

Derivatives of it take a tenth fewer operations than those of the kernel as it was written.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca

from ..code.kernels import operations_of

#: What makes an expression of an operation's arguments, where CasADi has no function of its name.
_MADE: dict[str, Callable[..., Any]] = {
    "add": lambda a, b: a + b,
    "sub": lambda a, b: a - b,
    "mul": lambda a, b: a * b,
    "div": lambda a, b: a / b,
    "neg": lambda a: -a,
    "choose": lambda a, b: ca.if_else(a, b, 0.0),
    "pow": lambda a, b: a**b,
    "lt": lambda a, b: a < b,
    "le": lambda a, b: a <= b,
    "eq": lambda a, b: a == b,
    "ne": lambda a, b: a != b,
    "not": ca.logic_not,
    "and": ca.logic_and,
    "or": ca.logic_or,
}


def simplified(function: ca.Function) -> ca.Function:
    """Return a kernel's function with the operations of its C."""
    graph = operations_of(function)
    columns = [ca.SX.sym(f"x{i}", size) for i, size in enumerate(graph.sizes)]
    values = list[ca.SX]()

    def read(reference: int) -> ca.SX:
        value = values[abs(reference) - 1]
        return value if reference > 0 else -value

    for node in graph.nodes:
        if node.name == "input":
            values.append(columns[node.arguments[0]][node.arguments[1]])
        elif node.name == "constant":
            values.append(ca.SX(node.value))
        else:
            make = _MADE.get(node.name) or getattr(ca, node.name)
            values.append(make(*map(read, node.arguments)))
    outputs = [ca.vertcat(*map(read, output)) if output else ca.SX(0, 1) for output in graph.outputs]
    return ca.Function("simplified", columns, outputs)
