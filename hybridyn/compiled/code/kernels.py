"""Generate the C of kernels: one function per kernel, one statement per operation, one name per value.

The text is the same for every number type; `Scalar.prelude` defines V and its arithmetic.

A division takes as long as eight to sixteen products, so quotients with a common divisor become products
with its reciprocal, which differ from the quotient by at most one and a half roundings. Products are fused
with the sums that read them: a b + c with one rounding. The compiler's own fusing is switched off
(`-ffp-contract=off`). Both are done in the graph, so all number types, lanes, drivers and compilers give the
same results, bit by bit. Reciprocals of constants are left to the compiler, in the number type of the code.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection

import casadi as ca

from ...spatial import Array
from ..program import Kernel
from .graph import TRUTH, Graph, Node, Reference, graph_of


def fused(graph: Graph) -> Graph:
    """Return a graph with products fused into the sums that read them.

    A product is fused if the product itself is then no longer needed: all its readers are sums, and none of
    them is already fused with another product.

    Args:
        graph: Graph without fused products.

    Returns:
        Graph of the same values up to rounding. "fma" has arguments (a, b, c) for a b + c, where a carries
        the sign of the product and c its own.
    """
    uses = _uses(graph)
    partner = _choices(graph, uses)
    out = Graph(graph.sizes, outputs=graph.outputs)
    for i, node in enumerate(graph.nodes):
        if i not in partner:
            out.nodes.append(node)
            continue
        product, rest = partner[i]
        a, b = graph.nodes[abs(product) - 1].arguments
        out.nodes.append(Node("fma", (a if product > 0 else -a, b, rest)))
    return out.used()


def _uses(graph: Graph) -> list[list[int]]:
    """Return for each node the nodes that read it; -1 stands for an output."""
    uses: list[list[int]] = [[] for _ in graph.nodes]
    for i, node in enumerate(graph.nodes):
        if node.name != "input":
            for x in node.arguments:
                uses[abs(x) - 1].append(i)
    for output in graph.outputs:
        for x in output:
            uses[abs(x) - 1].append(-1)
    return uses


def _choices(graph: Graph, uses: list[list[int]]) -> dict[int, tuple[Reference, Reference]]:
    """Choose for each sum the product that is fused into it: (product, rest) by node."""
    taken: dict[int, tuple[Reference, Reference]] = {}
    for i in reversed(range(len(graph.nodes))):  # of a sum's two products the later one is fused
        if graph.nodes[i].name != "mul":
            continue
        readers = uses[i]
        if all(j >= 0 and j not in taken and graph.nodes[j].name in ("add", "sub") for j in readers):
            pairs = {j: _split(graph.nodes[j], i) for j in readers}
            if all(abs(rest) != i + 1 for _, rest in pairs.values()):
                taken |= pairs
    return taken


def _split(node: Node, product: int) -> tuple[Reference, Reference]:
    """Return the product and the other term of a sum, both with their signs."""
    first, second = node.arguments
    if node.name == "sub":
        second = -second
    return (first, second) if abs(first) == product + 1 else (second, first)


def operations_of(function: ca.Function) -> Graph:
    """Convert a CasADi function to a graph with one division per divisor."""
    return shared_quotients(graph_of(function))


def shared_quotients(graph: Graph) -> Graph:
    """Return a graph in which no divisor that is a constant, or that divides twice, divides at run time."""
    divisors = Counter(node.arguments[1] for node in graph.nodes if node.name == "div")
    out, place = Graph(graph.sizes), [0]

    def moved(x: Reference) -> Reference:
        return place[abs(x)] * (1 if x > 0 else -1)

    for node in graph.nodes:
        if node.name == "input":
            place.append(out.node(node.name, *node.arguments))
        elif node.name != "div":
            place.append(out.node(node.name, *map(moved, node.arguments), value=node.value))
        else:
            x, divisor = map(moved, node.arguments)
            if divisors[node.arguments[1]] > 1 or out.value(divisor):
                place.append(out.product(x, out.quotient(out.constant(1.0), divisor)))
            else:
                place.append(out.quotient(x, divisor))
    out.outputs = [[out.plain(moved(x)) for x in output] for output in graph.outputs]
    return out.used()


INFIX = {"add": "+", "sub": "-", "mul": "*", "div": "/"}
#: C name of the fused a b + c, by the signs of the product and of c (True: positive).
FUSED = {(True, True): "FMA", (True, False): "FMS", (False, True): "FNMA", (False, False): "FNMS"}


def kernel_graph(kernel: Kernel) -> Graph:
    """Return a kernel's operations in the form that is printed, with fused products."""
    return fused(operations_of(kernel.function))


def kernel_text(graph: Graph, sums: Collection[int] = ()) -> str:
    """Return the arguments and body of a kernel in C, without a name: `(const V *restrict x0, ...) {...}`.

    Args:
        graph: Its operations.
        sums: Outputs that are added to what is there; others overwrite it.
    """
    arguments = [f"const V *restrict x{i}" for i, _ in enumerate(graph.sizes)]
    arguments += [f"V *restrict y{i}" for i, _ in enumerate(graph.outputs)]
    written: dict[int, list[str]] = {}
    for i, output in enumerate(graph.outputs):
        for k, x in enumerate(output):
            sign = "+=" if i in sums else "="
            written.setdefault(x - 1, []).append(f"    y{i}[{k}] {sign} {{}};")
    unused = [f"    (void)x{i};" for i, size in enumerate(graph.sizes) if not _reads(graph, i)]
    unused += [f"    (void)y{i};" for i, output in enumerate(graph.outputs) if not output]
    lines = [f"({', '.join(arguments)}) {{", *unused]
    lines += _statements(graph, written)
    return "\n".join([*lines, "}"])


def _reads(graph: Graph, argument: int) -> bool:
    """Return whether any operation reads an input."""
    return any(node.name == "input" and node.arguments[0] == argument for node in graph.nodes)


def _statements(graph: Graph, written: dict[int, list[str]]) -> list[str]:
    """Return the statements; each output is written as soon as it is computed."""
    lines: list[str] = []
    names: list[str] = []
    both = _sines(graph)
    for i, node in enumerate(graph.nodes):
        name = f"t{i}"
        if node.name == "input":
            name = f"x{node.arguments[0]}[{node.arguments[1]}]"
        elif node.name == "constant":
            name = f"C({literal(node.value)})"
        elif node.name in ("sin", "cos"):
            first = both[node.arguments[0]]
            name = f"{node.name[0]}{first}"
            if first == i:
                x = names[node.arguments[0] - 1]
                lines.append(f"    V s{i}, c{i};")
                lines.append(f"    SINCOS({x}, &s{i}, &c{i});")
        else:
            kind = "M" if node.name in TRUTH else "V"
            lines.append(f"    const {kind} {name} = {_expression(graph, node, names)};")
        names.append(name)
        value = f"NUMBER({name})" if node.name in TRUTH else name
        lines += [line.format(value) for line in written.get(i, ())]
    return lines


def _sines(graph: Graph) -> dict[int, int]:
    """Return for each argument of a sine or cosine the first node that reads it."""
    first: dict[int, int] = {}
    for i, node in enumerate(graph.nodes):
        if node.name in ("sin", "cos"):
            first.setdefault(node.arguments[0], i)
    return first


def _expression(graph: Graph, node: Node, names: list[str]) -> str:
    """Return the right-hand side of an operation."""

    def number(x: int) -> str:
        truth = graph.nodes[abs(x) - 1].name in TRUTH
        return f"NUMBER({names[abs(x) - 1]})" if truth else names[abs(x) - 1]

    def truth(x: int) -> str:
        known = graph.nodes[abs(x) - 1].name in TRUTH
        return names[abs(x) - 1] if known else f"TRUE({names[abs(x) - 1]})"

    x = node.arguments
    if node.name in INFIX:
        return f"{number(x[0])} {INFIX[node.name]} {number(x[1])}"
    if node.name == "neg":
        return f"-{number(x[0])}"
    if node.name == "fma":
        return f"{FUSED[x[0] > 0, x[2] > 0]}({number(x[0])}, {number(x[1])}, {number(x[2])})"
    if node.name == "choose":
        return f"CHOOSE({truth(x[0])}, {number(x[1])})"
    if node.name in ("not", "and", "or"):
        return f"{node.name.upper()}({', '.join(map(truth, x))})"
    return f"{node.name.upper()}({', '.join(map(number, x))})"


def literal(value: float) -> str:
    """Return a finite number or an infinity as an exact C literal."""
    if value in (float("inf"), float("-inf")):
        return "HUGE_VAL" if value > 0 else "-HUGE_VAL"
    return repr(float(value))


def table(values: Array) -> str:
    """Return numbers as the content of a C initialiser."""
    return ", ".join(literal(x) for x in values.ravel().tolist())
