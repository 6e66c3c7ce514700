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
from itertools import chain

import casadi as ca

from ..program import Kernel
from .c_tables import literal
from .graph import TRUTH, Graph, Operation, Reference, graph_of


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
    partner = _choices(graph)
    out = Graph(graph.sizes, outputs=graph.outputs)
    for i, node in enumerate(graph.nodes):
        if i not in partner:
            out.nodes.append(node)
            continue
        product, rest = partner[i]
        a, b = graph.nodes[abs(product) - 1].arguments
        out.nodes.append(Operation("fma", (a if product > 0 else -a, b, rest)))
    return out.used()


def _choices(graph: Graph) -> dict[int, tuple[Reference, Reference]]:
    """Choose for each sum the product that is fused into it: (product, rest) by node."""
    uses: list[list[int]] = [[] for _ in graph.nodes]  # the nodes that read each; -1 stands for an output
    for i, node in enumerate(graph.nodes):
        for x in node.arguments if node.name != "input" else ():
            uses[abs(x) - 1].append(i)
    for x in chain.from_iterable(graph.outputs):
        uses[abs(x) - 1].append(-1)
    taken: dict[int, tuple[Reference, Reference]] = {}
    sums = [node.name in ("add", "sub") for node in graph.nodes] + [False]  # the last one: no output is one
    for i in reversed(range(len(graph.nodes))):  # of a sum's two products the later one is fused
        if graph.nodes[i].name == "mul" and all(sums[j] and j not in taken for j in uses[i]):
            pairs = {j: _split(graph.nodes[j], i) for j in uses[i]}
            if all(abs(rest) != i + 1 for _, rest in pairs.values()):
                taken |= pairs
    return taken


def _split(node: Operation, product: int) -> tuple[Reference, Reference]:
    """Return the product and the other term of a sum, both with their signs."""
    first, second = node.arguments[0], node.arguments[1] * (-1 if node.name == "sub" else 1)
    return (first, second) if abs(first) == product + 1 else (second, first)


def operations_of(function: ca.Function) -> Graph:
    """Convert a CasADi function to a graph with one division per divisor."""
    return shared_quotients(graph_of(function))


def shared_quotients(graph: Graph) -> Graph:
    """Return a graph in which no divisor that is a constant, or that divides twice, divides at run time."""
    divisors = Counter(node.arguments[1] for node in graph.nodes if node.name == "div")
    if all(n == 1 and graph.nodes[x - 1].name != "constant" for x, n in divisors.items()):
        return graph

    def rule(out: Graph, i: int, node: Operation) -> Reference:
        """Return what becomes of an operation."""
        if node.name == "div":
            x, divisor = node.arguments
            constant = out.nodes[divisor - 1].name == "constant"
            if constant or divisors[graph.nodes[i].arguments[1]] > 1:
                return out.product(x, out.product(out.constant(1.0), divisor, "div"))
        return out.again(node)

    return graph.rebuilt(rule).used()


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
    reads = {node.arguments[0] for node in graph.nodes if node.name == "input"}
    unused = [f"    (void)x{i};" for i, _ in enumerate(graph.sizes) if i not in reads]
    unused += [f"    (void)y{i};" for i, output in enumerate(graph.outputs) if not output]
    lines = [f"({', '.join(arguments)}) {{", *unused]
    lines += _statements(graph, written)
    return "\n".join([*lines, "}"])


def _statements(graph: Graph, written: dict[int, list[str]]) -> list[str]:
    """Return the statements; each output is written as soon as it is computed."""
    lines: list[str] = []
    names: list[str] = []
    first: dict[int, int] = {}  # the first node that reads the argument of a sine or cosine
    for i, node in enumerate(graph.nodes):
        name = f"t{i}"
        if node.name == "input":
            name = f"x{node.arguments[0]}[{node.arguments[1]}]"
        elif node.name == "constant":
            name = f"C({literal(node.value)})"
        elif node.name in ("sin", "cos"):
            x = node.arguments[0]
            name = f"{node.name[0]}{first.setdefault(x, i)}"
            if first[x] == i:
                lines.append(f"    V s{i}, c{i};")
                lines.append(f"    SINCOS({names[x - 1]}, &s{i}, &c{i});")
        else:
            kind = "M" if node.name in TRUTH else "V"
            lines.append(f"    const {kind} {name} = {_expression(graph, node, names)};")
        names.append(name)
        value = f"NUMBER({name})" if node.name in TRUTH else name
        lines += [line.format(value) for line in written.get(i, ())]
    return lines


def _expression(graph: Graph, node: Operation, names: list[str]) -> str:
    """Return the right-hand side of an operation."""

    def read(x: Reference, truth: bool = False) -> str:
        """Return the name of an argument, as a number or as true or false."""
        name, known = names[abs(x) - 1], graph.nodes[abs(x) - 1].name in TRUTH
        return name if known is truth else f"{'TRUE' if truth else 'NUMBER'}({name})"

    x = node.arguments
    if node.name in INFIX:
        return f"{read(x[0])} {INFIX[node.name]} {read(x[1])}"
    if node.name == "neg":
        return f"-{read(x[0])}"
    if node.name == "fma":
        return f"{FUSED[x[0] > 0, x[2] > 0]}({', '.join(map(read, x))})"
    if node.name == "choose":
        return f"CHOOSE({read(x[0], True)}, {read(x[1])})"
    truth = node.name in ("not", "and", "or")
    return f"{node.name.upper()}({', '.join(read(y, truth) for y in x)})"
