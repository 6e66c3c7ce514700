"""Fuse products with the sums that read them: a b + c with one rounding.

The compiler's own fusing is switched off (`-ffp-contract=off`). Fusing here makes the results the same, bit
by bit, for every compiler, vector width and driver.
"""

from __future__ import annotations

from .graph import Graph, Node, Reference


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
