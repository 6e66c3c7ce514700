"""Generate the C of kernels: one function per kernel, one statement per operation, one name per value.

The text is the same for every number type; `Scalar.prelude` defines V and its arithmetic.
"""

from __future__ import annotations

from collections.abc import Collection

from ...spatial import Array
from ..program import Kernel
from .fusing import fused
from .graph import TRUTH, Graph, Node
from .quotients import operations_of

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
