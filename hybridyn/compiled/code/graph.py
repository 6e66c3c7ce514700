"""Graph of a kernel's operations, without duplicates, negations and unused operations.

A *reference* is a node with a sign: n + 1 for node n, -(n + 1) for its negative. Signs move outwards through
products and quotients and are absorbed in sums and differences. So negations cost nothing, and a - b and
b - a are one operation. All of that is exact in floating point.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import casadi as ca

Reference = int

SYMMETRIC = ("add", "fmin", "fmax", "hypot", "eq", "ne", "and", "or")
ODD = ("sin", "tan", "asin", "atan", "sinh", "tanh", "asinh", "atanh", "erf", "sign")
EVEN = ("cos", "cosh", "fabs")
ONE = ("sqrt", "acos", "exp", "log", "log1p", "expm1", "acosh", "floor", "ceil", "not")
TWO = (
    "fmin", "fmax", "atan2", "pow", "fmod", "hypot", "copysign", "remainder", "lt", "le", "eq", "ne", "and",
    "or",
)  # fmt: skip
#: Operations whose result is true or false.
TRUTH = ("lt", "le", "eq", "ne", "not", "and", "or")


@dataclass(frozen=True)
class Node:
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
    nodes: list[Node] = field(default_factory=list)
    outputs: list[list[Reference]] = field(default_factory=list)
    _known: dict[Node, int] = field(default_factory=dict)

    def node(self, name: str, *arguments: int, value: float = 0.0) -> Reference:
        """Return the reference of an operation, and add the operation if it is new."""
        if name in SYMMETRIC:
            arguments = tuple(sorted(arguments, key=abs))
        node = Node(name, arguments, value)
        if node not in self._known:
            self._known[node] = len(self.nodes)
            self.nodes.append(node)
        return self._known[node] + 1

    def constant(self, value: float) -> Reference:
        """Return the reference of a constant.

        Raises:
            ValueError: The constant is NaN.
        """
        if value != value:
            raise ValueError("a kernel has a constant that is NaN")
        return self.node("constant", value=value) if value >= 0 else -self.node("constant", value=-value)

    def value(self, x: Reference) -> float | None:
        """Return the value of a constant, or None for anything else."""
        node = self.nodes[abs(x) - 1]
        if node.name != "constant":
            return None
        return node.value if x > 0 else -node.value

    def add(self, a: Reference, b: Reference) -> Reference:
        """Return a + b."""
        if self.value(a) == 0.0:
            return b
        if self.value(b) == 0.0:
            return a
        if a < 0 and b < 0:
            return -self.add(-a, -b)
        if a < 0 or b < 0:
            first, second = (b, -a) if a < 0 else (a, -b)
            if first == second:
                return self.constant(0.0)
            return self.node("sub", first, second) if first < second else -self.node("sub", second, first)
        return self.node("add", a, b)

    def product(self, a: Reference, b: Reference) -> Reference:
        """Return a b."""
        sign = 1 if (a > 0) == (b > 0) else -1
        first, second = sorted((abs(a), abs(b)))
        for x, y in ((first, second), (second, first)):
            if self.value(x) == 1.0:
                return sign * y
        if self.value(first) == 0.0 or self.value(second) == 0.0:
            return self.constant(0.0)
        return sign * self.node("mul", first, second)

    def quotient(self, a: Reference, b: Reference) -> Reference:
        """Return a / b."""
        sign = 1 if (a > 0) == (b > 0) else -1
        if self.value(abs(b)) == 1.0:
            return sign * abs(a)
        return sign * self.node("div", abs(a), abs(b))

    def plain(self, x: Reference) -> Reference:
        """Return a positive reference to x, as functions and outputs need it."""
        return x if x > 0 else self.node("neg", -x)

    def function(self, name: str, x: Reference) -> Reference:
        """Return the reference of a function of one number."""
        if name in EVEN:
            return self.node(name, abs(x))
        if name in ODD:
            return self.node(name, abs(x)) * (1 if x > 0 else -1)
        return self.node(name, self.plain(x))

    def choose(self, condition: Reference, x: Reference) -> Reference:
        """Return x where a condition holds, else zero."""
        return self.node("choose", self.plain(condition), abs(x)) * (1 if x > 0 else -1)

    def used(self) -> Graph:
        """Return the graph without operations that no output depends on."""
        needed = [False] * len(self.nodes)
        for output in self.outputs:
            for x in output:
                needed[abs(x) - 1] = True
        for i in reversed(range(len(self.nodes))):
            if needed[i] and self.nodes[i].name != "input":
                for x in self.nodes[i].arguments:
                    needed[abs(x) - 1] = True
        out = Graph(self.sizes)
        place: dict[int, int] = {}

        def moved(x: Reference) -> Reference:
            return place[abs(x)] * (1 if x > 0 else -1)

        for i, node in enumerate(self.nodes):
            if needed[i]:
                arguments = node.arguments if node.name == "input" else tuple(map(moved, node.arguments))
                out.nodes.append(Node(node.name, arguments, node.value))
                place[i + 1] = len(out.nodes)
        out.outputs = [[moved(x) for x in output] for output in self.outputs]
        return out


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
    slots: dict[int, Reference] = {}
    for k in range(function.n_instructions()):
        code, out = function.instruction_id(k), function.instruction_output(k)
        read = function.instruction_input(k)
        if code == ca.OP_OUTPUT:
            graph.outputs[out[0]][out[1]] = graph.plain(slots[read[0]])
        elif code == ca.OP_INPUT:
            slots[out[0]] = graph.node("input", *read)
        elif code == ca.OP_CONST:
            slots[out[0]] = graph.constant(function.instruction_constant(k))
        else:
            arguments = [slots[i] for i in read]
            slots[out[0]] = _operation(graph, function.name(), code, arguments)
    for output in graph.outputs:  # entries that no instruction writes are structural zeros
        for i, x in enumerate(output):
            output[i] = x or graph.constant(0.0)
    return graph.used()


def _operation(graph: Graph, name: str, code: int, x: list[Reference]) -> Reference:
    """Return the reference of a CasADi instruction."""
    if code in _ARITHMETIC:
        return _ARITHMETIC[code](graph, x)
    for known in (*ONE, *ODD, *EVEN):
        if code == getattr(ca, f"OP_{known.upper()}", None):
            return graph.function(known, x[0])
    for known in TWO:
        if code == getattr(ca, f"OP_{known.upper()}"):
            return graph.node(known, *(graph.plain(y) for y in x))
    raise ValueError(f"{name}: instruction {code} of CasADi cannot be printed")


_ARITHMETIC: dict[int, Callable[[Graph, list[Reference]], Reference]] = {
    ca.OP_ASSIGN: lambda g, x: x[0],
    ca.OP_ADD: lambda g, x: g.add(x[0], x[1]),
    ca.OP_SUB: lambda g, x: g.add(x[0], -x[1]),
    ca.OP_MUL: lambda g, x: g.product(x[0], x[1]),
    ca.OP_DIV: lambda g, x: g.quotient(x[0], x[1]),
    ca.OP_NEG: lambda g, x: -x[0],
    ca.OP_SQ: lambda g, x: g.product(x[0], x[0]),
    ca.OP_TWICE: lambda g, x: g.add(x[0], x[0]),
    ca.OP_INV: lambda g, x: g.quotient(g.constant(1.0), x[0]),
    ca.OP_IF_ELSE_ZERO: lambda g, x: g.choose(x[0], x[1]),
    ca.OP_CONSTPOW: lambda g, x: g.node("pow", g.plain(x[0]), g.plain(x[1])),
}
