"""Graph of a kernel's operations, without duplicates, negations and unused operations.

A *reference* is a node with a sign: n + 1 for node n, -(n + 1) for its negative. Signs move outwards through
products and quotients and are absorbed in sums and differences. So negations cost nothing, and a - b and
b - a are one operation. All of that is exact in floating point.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import casadi as ca

Reference = int

SYMMETRIC = ("add", "mul", "fmin", "fmax", "hypot", "eq", "ne", "and", "or")
ODD = ("sin", "tan", "asin", "atan", "sinh", "tanh", "asinh", "atanh", "erf", "sign")
EVEN = ("cos", "cosh", "fabs")
ONE = ("sqrt", "acos", "exp", "log", "log1p", "expm1", "acosh", "floor", "ceil", "not")
TWO = (
    "fmin", "fmax", "atan2", "pow", "fmod", "hypot", "copysign", "remainder", "lt", "le", "eq", "ne", "and",
    "or",
)  # fmt: skip
#: Operations whose result is true or false.
TRUTH = ("lt", "le", "eq", "ne", "not", "and", "or")


class Operation(NamedTuple):
    """An operation.

    Attributes:
        name: "input", "constant", "add", "sub", "mul", "div", "neg", "choose" (the second argument where the
            first is true, else zero), "fma" (a b + c) or a function of `ONE`, `TWO`, `ODD`, `EVEN`.
        arguments: References; for "input" the indices of the argument and of its entry.
        value: Value of a constant.
    """

    name: str
    arguments: tuple[int, ...]
    value: float = 0.0


@dataclass
class Graph:
    """A kernel's operations in order of evaluation.

    Attributes:
        sizes: Number of entries of each input.
        nodes: The operations.
        outputs: For each output the references of its entries.
    """

    sizes: list[int]
    nodes: list[Operation] = field(default_factory=list)
    outputs: list[list[Reference]] = field(default_factory=list)
    _known: dict[Operation, int] = field(default_factory=dict)

    def node(self, name: str, *arguments: int, value: float = 0.0) -> Reference:
        """Return the reference of an operation, and add the operation if it is new."""
        if name in SYMMETRIC and abs(arguments[0]) > abs(arguments[1]):
            arguments = arguments[::-1]
        node, new = Operation(name, arguments, value), len(self.nodes)
        known = self._known.setdefault(node, new)
        if known == new:
            self.nodes.append(node)
        return known + 1

    def again(self, node: Operation) -> Reference:
        """Return the reference of a node of another graph, whose arguments are references here."""
        return self.node(node.name, *node.arguments, value=node.value)

    def constant(self, value: float) -> Reference:
        """Return the reference of a constant.

        Raises:
            ValueError: The constant is NaN.
        """
        if value != value:
            raise ValueError("a kernel has a constant that is NaN")
        return self.node("constant", value=value) if value >= 0 else -self.node("constant", value=-value)

    def add(self, a: Reference, b: Reference) -> Reference:
        """Return a + b."""
        if a < 0 and b < 0:
            return -self.node("add", -a, -b)
        if a > 0 and b > 0:
            return self.node("add", a, b)
        first, second = (b, -a) if a < 0 else (a, -b)
        return self.node("sub", first, second) if first < second else -self.node("sub", second, first)

    def product(self, a: Reference, b: Reference, name: str = "mul") -> Reference:
        """Return a b, or what "div" or "choose" make of both: its sign is that of a b."""
        return self.node(name, abs(a), abs(b)) * (1 if (a > 0) == (b > 0) else -1)

    def plain(self, x: Reference) -> Reference:
        """Return a positive reference to x, as functions and outputs need it."""
        return x if x > 0 else self.node("neg", -x)

    def function(self, name: str, x: list[Reference]) -> Reference:
        """Return the reference of a function."""
        if name in EVEN:
            return self.node(name, abs(x[0]))
        if name in ODD:
            return self.node(name, abs(x[0])) * (1 if x[0] > 0 else -1)
        return self.node(name, *map(self.plain, x))

    def rebuilt(self, rule: Callable[[Graph, int, Operation], Reference]) -> Graph:
        """Return the graph of what a rule adds for each node, given its index, with arguments in it."""
        out, place = Graph(self.sizes), [0] * (2 * len(self.nodes) + 1)  # place[-i] is that of the negative
        for i, node in enumerate(self.nodes):
            place[i + 1] = new = rule(out, i, _moved(node, place))
            place[-i - 1] = -new
        out.outputs = [[out.plain(place[x]) for x in output] for output in self.outputs]
        return out

    def used(self) -> Graph:
        """Return the graph without operations that no output depends on; nothing is added to it later."""
        n = len(self.nodes)
        needed, place = bytearray(n + 1), [0] * (2 * n + 1)
        for output in self.outputs:
            for x in output:
                needed[x] = 1
        for i in range(n, 0, -1):
            if needed[i] and self.nodes[i - 1].name != "input":
                for x in self.nodes[i - 1].arguments:
                    needed[abs(x)] = 1
        if sum(needed) == n:
            return self
        nodes: list[Operation] = []
        for i, node in enumerate(self.nodes, 1):
            if needed[i]:
                nodes.append(_moved(node, place))
                place[i], place[-i] = len(nodes), -len(nodes)
        return Graph(self.sizes, nodes, [[place[x] for x in output] for output in self.outputs])


def _moved(node: Operation, place: list[Reference]) -> Operation:
    """Return a node of a graph with the places of its arguments in another; place[-i] is that of -i."""
    if node.name == "input":
        return node
    return Operation(node.name, tuple([place[x] for x in node.arguments]), node.value)


def graph_of(function: ca.Function) -> Graph:
    """Convert a CasADi function of scalars to a graph.

    Raises:
        ValueError: An operation cannot be printed, or an output is sparse.
    """
    for i in range(function.n_out()):
        if not function.sparsity_out(i).is_dense():
            raise ValueError(f"{function.name()}: output {i} is sparse")
    graph = Graph([function.nnz_in(i) for i in range(function.n_in())])
    graph.outputs = [[0] * function.nnz_out(i) for i in range(function.n_out())]
    name, slots = function.name(), dict[int, Reference]()
    code_of, read_by, written_by = (
        function.instruction_id, function.instruction_input, function.instruction_output,
    )  # fmt: skip
    for k in range(function.n_instructions()):
        code, out, read = code_of(k), written_by(k), read_by(k)
        if code == ca.OP_OUTPUT:
            graph.outputs[out[0]][out[1]] = graph.plain(slots[read[0]])
        elif code == ca.OP_INPUT:
            slots[out[0]] = graph.node("input", *read)
        elif code == ca.OP_CONST:
            slots[out[0]] = graph.constant(function.instruction_constant(k))
        else:
            slots[out[0]] = _operation(graph, name, code, [slots[i] for i in read])
    # Entries that no instruction writes are structural zeros.
    graph.outputs = [[x or graph.constant(0.0) for x in output] for output in graph.outputs]
    return graph.used()


def _operation(graph: Graph, name: str, code: int, x: list[Reference]) -> Reference:
    """Return the reference of a CasADi instruction."""
    if code in _ARITHMETIC:
        return _ARITHMETIC[code](graph, x)
    if code not in _FUNCTIONS:
        raise ValueError(f"{name}: instruction {code} of CasADi cannot be printed")
    return graph.function(_FUNCTIONS[code], x)


_FUNCTIONS = {getattr(ca, f"OP_{name.upper()}"): name for name in (*ONE, *ODD, *EVEN, *TWO)}
_ARITHMETIC: dict[int, Callable[[Graph, list[Reference]], Reference]] = {
    ca.OP_ASSIGN: lambda g, x: x[0],
    ca.OP_ADD: lambda g, x: g.add(x[0], x[1]),
    ca.OP_SUB: lambda g, x: g.add(x[0], -x[1]),
    ca.OP_MUL: lambda g, x: g.product(x[0], x[1]),
    ca.OP_DIV: lambda g, x: g.product(x[0], x[1], "div"),
    ca.OP_NEG: lambda g, x: -x[0],
    ca.OP_SQ: lambda g, x: g.product(x[0], x[0]),
    ca.OP_TWICE: lambda g, x: g.add(x[0], x[0]),
    ca.OP_INV: lambda g, x: g.product(g.constant(1.0), x[0], "div"),
    ca.OP_IF_ELSE_ZERO: lambda g, x: g.product(g.plain(x[0]), x[1], "choose"),
    ca.OP_CONSTPOW: lambda g, x: g.function("pow", x),
}
