"""Divide once per divisor: quotients with a common divisor become products with its reciprocal.

A division takes as long as eight to sixteen products. A product with the reciprocal differs from the quotient
by at most one and a half roundings. The change is made in the graph, so all number types, lanes and drivers
have the same operations. Reciprocals of constants are left to the compiler, in the number type of the code.
"""

from __future__ import annotations

from collections import Counter

import casadi as ca

from .graph import Graph, Reference, graph_of


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
