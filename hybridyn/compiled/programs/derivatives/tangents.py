"""Forward sweep over the nodes of a program: columns of derivatives, one column in each lane.

A tangent is the change of a number of the program that one column of changes of the inputs causes. A number
that several copies or nodes add to has its tangent in parts, which whoever needs it adds up.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import casadi as ca

from ...equations.expressions import pack
from ...program import Constants, Own, Shared, Source, Target, Turned
from ..writer import Writer
from .adjoints import PART, Parts, Reading, evaluated
from .linear import Linear, linearized
from .local import Local, local_jacobian
from .nodes import Node, Number, identity, numbers_of

#: Places of local derivatives, and linear steps with the place of their coefficients, which sweeps share.
Known = dict[Any, Any]


@dataclass(frozen=True)
class Graph:
    """Nodes between inputs and results.

    Attributes:
        nodes: The nodes in order of evaluation.
        live: Numbers that depend on the inputs.
        needed: Numbers that the results depend on.
    """

    nodes: list[Node]
    live: set[Number]
    needed: set[Number]

    def towards(self, results: Sequence[Source | Target]) -> list[Node]:
        """Return the nodes that some of the results depend on."""
        part = Graph.between(self.nodes, [], results)
        return [x for x in self.nodes if any(not part.needed.isdisjoint(x.numbers(y)) for y in x.targets)]

    @classmethod
    def between(
        cls, nodes: list[Node], inputs: Sequence[Source], results: Sequence[Source | Target]
    ) -> Graph:
        """Return the graph of nodes between inputs and results."""
        live = {x for end in inputs for x in numbers_of(end, 0)}
        needed = {x for end in results for x in numbers_of(end, 0)}
        for node in nodes:
            if any(x in live for source in node.sources for x in node.numbers(source)):
                live.update(x for target in node.targets for x in node.numbers(target))
        for node in reversed(nodes):
            _require(node, needed)
        return cls(nodes, live, needed)


def _require(node: Node, needed: set[Number]) -> None:
    """Add the numbers of a node's sources on which needed numbers of its targets depend."""
    for n, target in enumerate(node.targets):
        ends = [numbers_of(target, copy) for copy in range(node.copies)]
        wanted = {k for numbers in ends for k, x in enumerate(numbers) if x in needed}
        for s, source in enumerate(node.sources) if wanted else ():
            rows, columns = node.function.jac_sparsity(n, s, True).get_triplet()
            used = {c for r, c in zip(rows, columns, strict=True) if r in wanted}
            for copy in range(node.copies) if used else ():
                numbers = numbers_of(source, copy)
                needed.update(numbers[k] for k in used if k < len(numbers))


@dataclass
class Tangents:
    """Tangents of the numbers of a program.

    Attributes:
        writer: The program under construction.
        columns: Number of columns.
        known: Places of local derivatives.
        of: The parts of each number's tangent; numbers that do not change are left out.
    """

    writer: Writer
    columns: int
    known: Known
    of: dict[Number, Parts] = field(default_factory=dict)

    def seed(self, source: Source, block: Own | Constants | Turned) -> None:
        """Set the tangents of a source's numbers: one lane of `block` for each column."""
        for k, number in enumerate(numbers_of(source, 0)):
            self.of.setdefault(number, []).append((block, k))

    def sweep(self, graph: Graph, nodes: list[Node] | None = None) -> None:
        """Add the calls that compute the tangents of all needed numbers that the seeds change.

        Args:
            graph: The nodes; their local derivatives are the same for all sweeps that share `known`.
            nodes: Those of its nodes that are swept; default all.
        """
        for node in graph.nodes if nodes is None else nodes:
            self._forwards(node, graph)

    def _forwards(self, node: Node, graph: Graph) -> None:
        """Add the calls of one node: its local derivatives and the tangents of its targets."""
        if not any(x in self.of for source in node.sources for x in node.numbers(source)):
            return
        used = graph.live & graph.needed
        ins = [n for n, x in enumerate(node.sources) if not used.isdisjoint(node.numbers(x))]
        outs = [n for n, x in enumerate(node.targets) if not graph.needed.isdisjoint(node.numbers(x))]
        if not outs:
            return
        key = (node.key, tuple(map(identity, node.sources)), tuple(ins), tuple(outs))
        if key not in self.known:
            self.known[key] = self._differentiated(node, ins, outs, graph)
        local = self.known[key]
        if isinstance(local, Linear):
            self._linear(node, local)
            return
        summed, each = evaluated(self.writer, self.known, node, local)
        if local.summed:
            self._one(node, 0, (local.key, True), local.summed, summed)
        if local.own:
            for i in range(node.copies):
                values = Shared(each.start + i * each.size, each.size)
                self._one(node, i, (local.key, False), local.own, values)

    def _differentiated(self, node: Node, ins: list[int], outs: list[int], graph: Graph) -> Local | Linear:
        """Differentiate a node; with one copy, in the way that takes fewer operations.

        The operations are those of one sweep for each of its sources, and of its coefficients or derivatives.
        """
        if node.copies > 1:
            return local_jacobian(node, ins, outs, *node.common(ins, outs))
        numbers = [(n, numbers_of(node.targets[n], 0)) for n in outs]
        ends = [(n, k) for n, of in numbers for k, x in enumerate(of) if x in graph.needed]
        linear = linearized(node, ins, ends)
        local = local_jacobian(node, ins, outs, *node.common(ins, outs), ends)
        sweeps = [[(n, k) for k in range(node.function.nnz_in(n))] for n in ins]
        steps = self.columns * sum(map(linear.operations, sweeps)) + linear.coefficients.n_instructions()
        products = self.columns * 2 * len(local.summed) + local.function.n_instructions()
        return linear if steps < products else local

    def _one(self, node: Node, copy: int, key: Any, entries: Sequence[Any], values: Shared) -> None:
        """Add the tangents of the targets of one copy (or of all, from the sum of their derivatives)."""
        changed = {
            s: [number in self.of for number in numbers_of(node.sources[s], copy)] for _, _, s, _ in entries
        }
        used = [k for k, (_, _, s, col) in enumerate(entries) if changed[s][col]]
        wanted = sorted({entries[k][2:] for k in used})
        if not wanted:
            return
        reading = Reading.of([self.of[numbers_of(node.sources[s], copy)[col]] for s, col in wanted])
        rows: dict[int, list[int]] = {}
        for k in used:
            n, row = entries[k][:2]
            if row not in rows.setdefault(n, []):
                rows[n].append(row)

        def function() -> ca.Function:
            """Return the products of derivatives and tangents."""
            J = ca.SX.sym("J", len(entries))
            blocks, tangents = reading.symbols()
            known = dict(zip(wanted, tangents, strict=True))
            sums: dict[tuple[int, int], Any] = {}
            for k in used:
                n, row, s, col = entries[k]
                sums[n, row] = sums.get((n, row), 0.0) + J[k] * known[s, col]
            return ca.Function("forward", [J, *blocks], [pack([sums[n, r] for r in rows[n]]) for n in rows])

        w = self.writer
        places = [w.own(self.columns, len(of)) for of in rows.values()]
        whole = ("forward", key, reading.key, tuple(wanted), tuple((n, tuple(of)) for n, of in rows.items()))
        w.call(w.kernel(whole, function, PART), self.columns, [values, *reading.blocks], list(places))
        for place, (n, of) in zip(places, rows.items(), strict=True):
            numbers = numbers_of(node.targets[n], copy)
            for k, row in enumerate(of):
                self.of.setdefault(numbers[row], []).append((place, k))

    def _linear(self, node: Node, linear: Linear) -> None:
        """Add the tangents of the targets of a node with one copy, step by step."""
        w = self.writer
        key = (linear.key, tuple(map(identity, node.sources)))
        if key not in self.known:
            self.known[key] = w.shared(linear.size)
            if linear.size:
                kernel = w.kernel(linear.key, linear.coefficients, PART)
                w.call(kernel, 1, list(node.sources), [self.known[key]])
        place = self.known[key]
        of = {x: numbers_of(node.sources[x[0]], 0)[x[1]] for x in linear.inputs}
        wanted, rows = linear.used([x for x, number in of.items() if number in self.of])
        if not rows:
            return
        reading = Reading.of([self.of[of[x]] for x in wanted])
        targets = sorted({n for n, _ in rows})

        def function() -> ca.Function:
            """Return the tangents of one column."""
            numbers = ca.SX.sym("numbers", linear.size)
            blocks, values = reading.symbols()
            found = linear.tangents(numbers, dict(zip(wanted, values, strict=True)), rows)
            outputs = [pack([x for (n, _), x in zip(rows, found, strict=True) if n == m]) for m in targets]
            return ca.Function("steps", [numbers, *blocks], outputs)

        places = [w.own(self.columns, sum(n == m for n, _ in rows)) for m in targets]
        kernel = w.kernel((linear.key, reading.key, tuple(wanted)), function, PART)
        w.call(kernel, self.columns, [place, *reading.blocks], list(places))
        for block, m in zip(places, targets, strict=True):
            numbers = numbers_of(node.targets[m], 0)
            for k, row in enumerate(r for n, r in rows if n == m):
                self.of.setdefault(numbers[row], []).append((block, k))

    def reading(self, numbers: Sequence[Number]) -> Reading:
        """Return the reading of the tangents of some numbers; those that do not change read zeros."""
        return Reading.of([self.of.get(number, []) for number in numbers])

    def gather(self, numbers: Sequence[Number], targets: Sequence[Target]) -> None:
        """Add the call that writes the tangents of some numbers to each of the targets."""
        reading = self.reading(numbers)

        def function() -> ca.Function:
            """Return the sums of the parts."""
            blocks, values = reading.symbols()
            return ca.Function("gather", blocks, [pack(values)] * len(targets))

        kernel = self.writer.kernel(("gather", reading.key, len(targets)), function, PART)
        self.writer.call(kernel, self.columns, list(reading.blocks), list(targets))
