"""Reverse sweep over the nodes of a program: rows of derivatives, one row in each lane.

An adjoint is the derivative of a chosen number, one for each row, over a number of the program. Each node
reads the adjoints of its targets from blocks and writes those of its sources to new blocks. A number that
several nodes read has its adjoint in parts, which whoever needs it adds up.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from ...equations.expressions import pack
from ...program import Constants, Each, Own, Shared, Source, Target, Turned
from ..writer import Writer
from .local import Local, local_jacobian
from .nodes import Node, Number, identity, numbers_of

#: Heading of derivatives in operation counts.
PART = "derivatives"
#: Heading of what grows as the result does, with the square of the number of modules.
DENSE = "dense derivatives"

Pattern = NDArray[np.bool_]
#: Parts of an adjoint: the block and the entry in it.
Parts = list[tuple[Own | Constants | Turned, int]]


@dataclass
class Reading:
    """Reading of adjoints from blocks.

    Attributes:
        blocks: The blocks, each once.
        pattern: For each adjoint the block and the entry of its parts.
    """

    blocks: list[Own | Constants | Turned]
    pattern: tuple[tuple[tuple[int, int], ...], ...]

    @classmethod
    def of(cls, adjoints: list[Parts]) -> Reading:
        """Return the reading of some adjoints."""
        blocks: list[Own | Constants | Turned] = []
        known: dict[int, int] = {}
        pattern = []
        for parts in adjoints:
            entries = []
            for block, k in parts:
                if id(block) not in known:
                    known[id(block)] = len(blocks)
                    blocks.append(block)
                entries.append((known[id(block)], k))
            pattern.append(tuple(entries))
        return cls(blocks, tuple(pattern))

    def symbols(self) -> tuple[list[ca.SX], list[Any]]:
        """Return symbols of the blocks, and the adjoints as expressions."""
        columns = [ca.SX.sym(f"block{i}", block_size(block)) for i, block in enumerate(self.blocks)]
        values = []
        for entries in self.pattern:
            value: Any = 0.0
            for i, k in entries:
                value = value + columns[i][k]
            values.append(value)
        return columns, values

    @property
    def key(self) -> Any:
        """What equal readings have in common."""
        return tuple(map(block_size, self.blocks)), self.pattern


def block_size(block: Own | Constants | Turned) -> int:
    """Return the number of entries that a lane reads from a block."""
    if isinstance(block, Turned):
        return block.rows
    return int(block.values.shape[1]) if isinstance(block, Constants) else block.size


def evaluated(
    w: Writer, known: dict[Any, tuple[Shared, Each]], node: Node, local: Local
) -> tuple[Shared, Each]:
    """Return the places of a node's local derivatives: sums over its copies, and those of each copy.

    Args:
        w: The program under construction.
        known: Places of local derivatives; those of the node are computed once and added.
    """
    key = local.key, tuple(map(identity, node.sources))
    if key not in known:
        summed = w.shared(len(local.summed))
        added: Target = summed if node.copies == 1 else w.start(summed, np.zeros(summed.size))
        each = w.each(node.copies, len(local.own))
        kernel = w.kernel(("local", local.key), local.function, PART)
        w.call(kernel, node.copies, list(node.sources), [added, each])
        known[key] = summed, each
    return known[key]


@dataclass
class Adjoints:
    """Adjoints of the numbers of a program.

    Attributes:
        writer: The program under construction.
        rows: Number of rows.
        of: The parts of each number's adjoint.
        known: Places of local derivatives, which several sweeps may share.
        part: Heading of its products in operation counts.
        patterns: Which entries of each block are not always zero, by the block's identity.
    """

    writer: Writer
    rows: int
    known: dict[Any, tuple[Shared, Each]] = field(default_factory=dict)
    part: str = PART
    of: dict[Number, Parts] = field(default_factory=dict)
    patterns: dict[int, Pattern] = field(default_factory=dict)

    def seed(self, target: Target, first: int = 0) -> None:
        """Take the numbers of a target as those to be differentiated, in the rows from `first` on."""
        numbers = numbers_of(target, 0)
        block = Constants(np.eye(self.rows)[:, first : first + len(numbers)])
        self._add(block, block.values != 0.0, numbers)

    def _add(self, block: Own | Constants, pattern: Pattern, numbers: list[Number]) -> None:
        """Add a block to the adjoints of numbers."""
        self.patterns[id(block)] = pattern
        for k, number in enumerate(numbers):
            self.of.setdefault(number, []).append((block, k))

    def pattern(self, parts: Parts) -> Pattern:
        """Return in which rows an adjoint is not always zero, shape (rows,)."""
        out = np.zeros(self.rows, dtype=bool)
        for block, k in parts:
            out |= self.patterns[id(block)][:, k]
        return out

    def sweep(self, nodes: list[Node], live: set[Number]) -> None:
        """Add the calls that compute the adjoints of live numbers.

        Args:
            nodes: The nodes in order of evaluation.
            live: Numbers over which to differentiate; numbers that depend on them are added.
        """
        for node in nodes:
            if any(x in live for source in node.sources for x in node.numbers(source)):
                live.update(x for target in node.targets for x in node.numbers(target))
        for node in reversed(nodes):
            self._backwards(node, live)

    def _backwards(self, node: Node, live: set[Number]) -> None:
        """Add the calls of one node: its local derivatives and the adjoints of its sources."""
        copies = range(node.copies)
        ins = [n for n, source in enumerate(node.sources) if any(x in live for x in node.numbers(source))]
        outs = [n for n, target in enumerate(node.targets) if any(x in self.of for x in node.numbers(target))]
        if not ins or not outs:
            return
        local = local_jacobian(node, ins, outs, *node.common(ins, outs))
        summed, each = evaluated(self.writer, self.known, node, local)
        if local.summed:
            self._one(node, 0, local, summed, True, live)
        if local.own:
            for i in copies:
                self._one(node, i, local, Shared(each.start + i * each.size, each.size), False, live)

    def _one(
        self, node: Node, copy: int, local: Local, values: Shared, summed: bool, live: set[Number]
    ) -> None:
        """Add the adjoints of the sources of one copy (or of all, from the sum of their derivatives)."""
        entries = local.summed if summed else local.own
        numbers = {n: numbers_of(node.targets[n], copy) for n, *_ in entries}
        wanted = sorted({(n, row) for n, row, *_ in entries if numbers[n][row] in self.of})
        reading = Reading.of([self.of[numbers[n][row]] for n, row in wanted])
        at = {x: k for k, x in enumerate(wanted)}
        columns: dict[int, list[int]] = {}
        for n, row, s, col in entries:
            if (n, row) in at and numbers_of(node.sources[s], copy)[col] in live:
                columns.setdefault(s, [])
                if col not in columns[s]:
                    columns[s].append(col)
        if not columns:
            return
        outs = tuple((s, tuple(cols)) for s, cols in columns.items())
        key = ("reverse", local.key, summed, reading.key, tuple(wanted), outs)

        def function() -> ca.Function:
            """Return the products of derivatives and adjoints."""
            J = ca.SX.sym("J", len(entries))
            blocks, adjoints = reading.symbols()
            sums: dict[tuple[int, int], Any] = {}
            for k, (n, row, s, col) in enumerate(entries):
                if (n, row) in at:
                    sums[s, col] = sums.get((s, col), 0.0) + J[k] * adjoints[at[n, row]]
            outputs = [pack([sums[s, col] for col in cols]) for s, cols in columns.items()]
            return ca.Function("reverse", [J, *blocks], outputs)

        w = self.writer
        places = [w.own(self.rows, len(cols)) for cols in columns.values()]
        w.call(w.kernel(key, function, self.part), self.rows, [values, *reading.blocks], list(places))
        rows = {(n, row): self.pattern(self.of[numbers[n][row]]) for n, row in wanted}
        for place, (s, cols) in zip(places, columns.items(), strict=True):
            source = numbers_of(node.sources[s], copy)
            pattern = np.zeros((self.rows, len(cols)), dtype=bool)
            for n, row, s_of, col in entries:
                if s_of == s and (n, row) in at and col in cols:
                    pattern[:, cols.index(col)] |= rows[n, row]
            self._add(place, pattern, [source[col] for col in cols])

    def parts(self, source: Source) -> list[Parts]:
        """Return the parts of the adjoints of a source's numbers."""
        return [self.of.get(number, []) for number in numbers_of(source, 0)]
