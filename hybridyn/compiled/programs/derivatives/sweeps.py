"""Join the stages of a program to nodes, differentiate these, and sweep over them, forwards or back.

A node is a function of what is not passed from stage to stage. In a sweep one column or row of derivatives is
in each lane. A tangent is the change of a number that one column of changes causes; an adjoint is the
derivative of a chosen number, one for each row, over a number. Each node reads those of the numbers on its
one side from blocks and writes those on its other side to a new block. A number that several nodes write has
parts, which whoever needs it adds up.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import casadi as ca
import numpy as np

from ....spatial import Mask
from ...equations.expressions import pack
from ...program import Constants, Each, Own, Shared, Source, Target
from ..writer import Writer
from .nodes import Local, Number, StageNode, identity, local_jacobian

#: Heading of derivatives in operation counts.
PART = "derivatives"
#: Heading of what grows as the result does, with the square of the number of modules.
DENSE = "dense derivatives"

#: A block of numbers, one row or column in each lane.
Block = Own | Constants | Each
#: Parts of a tangent or an adjoint: the block and the entry in it.
Parts = list[tuple[Block, int]]


@dataclass
class Reading:
    """Reading of tangents or adjoints from blocks.

    Attributes:
        blocks: The blocks, each once.
        pattern: For each of them the block and the entry of its parts.
    """

    blocks: list[Block]
    pattern: tuple[tuple[tuple[int, int], ...], ...]

    @classmethod
    def of(cls, wanted: Sequence[Parts]) -> Reading:
        """Return the reading of some tangents or adjoints; one without parts is zero."""
        blocks = {id(block): block for parts in wanted for block, _ in parts}
        at = {key: i for i, key in enumerate(blocks)}
        return cls(list(blocks.values()), tuple(tuple((at[id(x)], k) for x, k in parts) for parts in wanted))

    def symbols(self) -> tuple[list[ca.SX], list[Any]]:
        """Return symbols of the blocks, and what is read as expressions."""
        columns = [ca.SX.sym(f"block{i}", block_size(block)) for i, block in enumerate(self.blocks)]
        return columns, [sum((columns[i][k] for i, k in parts), 0.0) for parts in self.pattern]

    @property
    def key(self) -> Any:
        """What equal readings have in common."""
        return tuple(map(block_size, self.blocks)), self.pattern


def block_size(block: Block) -> int:
    """Return the number of entries that a lane reads from a block."""
    return int(block.values.shape[1]) if isinstance(block, Constants) else block.size


@dataclass(frozen=True)
class ProgramGraph:
    """Nodes between inputs and results.

    Attributes:
        nodes: The nodes in order of evaluation.
        live: Numbers that depend on the inputs.
        needed: Numbers that the results depend on.
    """

    nodes: list[StageNode]
    live: set[Number]
    needed: set[Number]

    @classmethod
    def between(
        cls, nodes: list[StageNode], inputs: Sequence[Source], results: Sequence[Source | Target]
    ) -> ProgramGraph:
        """Return the graph of nodes between inputs and results."""
        live = {x for end in inputs for x in end.numbers(0)}
        needed = {x for end in results for x in end.numbers(0)}
        for node in nodes:
            if any(x in live for source in node.sources for x in node.numbers(source)):
                live.update(x for target in node.targets for x in node.numbers(target))
        for node in reversed(nodes):
            _require(node, needed)
        return cls(nodes, live, needed)


def _require(node: StageNode, needed: set[Number]) -> None:
    """Add the numbers of a node's sources on which needed numbers of its targets depend."""
    for n, target in enumerate(node.targets):
        ends = [target.numbers(copy) for copy in range(node.copies)]
        wanted = {k for numbers in ends for k, x in enumerate(numbers) if x in needed}
        for s, source in enumerate(node.sources) if wanted else ():
            rows, columns = node.function.jac_sparsity(n, s, True).get_triplet()
            used = {c for r, c in zip(rows, columns, strict=True) if r in wanted}
            for copy in range(node.copies) if used else ():
                numbers = source.numbers(copy)
                needed.update(numbers[k] for k in used if k < len(numbers))


def _sums(ends: int, reading: Reading, terms: Sequence[tuple[int, int, int]], outputs: int) -> ca.Function:
    """Write sums of products of derivatives with what is known on one side of them.

    Args:
        ends: Number of derivatives.
        reading: What is known.
        terms: For each product the numbers of its derivative, of what is known, and of its sum.
        outputs: Number of sums.
    """
    J = ca.SX.sym("J", ends)
    blocks, known = reading.symbols()
    sums: list[Any] = [0.0] * outputs
    for k, i, j in terms:
        sums[j] = sums[j] + J[k] * known[i]
    return ca.Function("products", [J, *blocks], [pack(sums)])


@dataclass(eq=False)
class Sweep:
    """Tangents or adjoints of the numbers of a program.

    Attributes:
        writer: The program under construction.
        lanes: Number of columns or rows.
        known: Local derivatives and their places, which several sweeps may share.
        part: Heading of its products in operation counts.
        of: The parts of each number's tangent or adjoint; of others it is zero.
        filled: Which entries of a block are not always zero, shape (lanes, entries); of others all may be.
    """

    writer: Writer
    lanes: int
    known: dict[Any, tuple[Local, Shared, Each]] = field(default_factory=dict)
    part: str = PART
    of: dict[Number, Parts] = field(default_factory=dict)
    filled: dict[Block, Mask] = field(default_factory=dict)

    def seed(self, end: Source | Target | list[Number], block: Block) -> None:
        """Set the tangents or adjoints of numbers: one lane of `block` for each column or row."""
        for k, number in enumerate(end if isinstance(end, list) else end.numbers(0)):
            self.of.setdefault(number, []).append((block, k))

    def through(self, graph: ProgramGraph, *, back: bool = False) -> None:
        """Add the calls that compute what the seeds change or, `back`, what changes the seeds.

        These are the tangents of all needed numbers, or the adjoints of all live ones.
        """
        for node in graph.nodes[:: -1 if back else 1]:
            ends = node.targets if back else node.sources
            if any(x in self.of for end in ends for x in node.numbers(end)):
                self._node(node, graph, back=back)

    def reading(self, numbers: Sequence[Number]) -> Reading:
        """Return the reading of the tangents or adjoints of some numbers."""
        return Reading.of([self.of.get(number, []) for number in numbers])

    def pattern(self, numbers: Sequence[Number]) -> Mask:
        """Return which tangents or adjoints of some numbers are not always zero, shape (lanes, numbers)."""
        out = np.zeros((self.lanes, len(numbers)), dtype=bool)
        for i, number in enumerate(numbers):
            for block, k in self.of.get(number, []):
                if isinstance(block, Constants):
                    out[:, i] |= block.values[:, k] != 0.0
                else:
                    out[:, i] |= self.filled[block][:, k] if block in self.filled else True
        return out

    def _node(self, node: StageNode, graph: ProgramGraph, *, back: bool) -> None:
        """Add the calls of one node: its local derivatives and what they lead to, copy by copy."""
        used = graph.live & graph.needed
        ins = [n for n, x in enumerate(node.sources) if not used.isdisjoint(node.numbers(x))]
        outs = [n for n, x in enumerate(node.targets) if not graph.needed.isdisjoint(node.numbers(x))]
        if not ins or not outs:
            return
        local, summed, each = self._evaluated(node, ins, outs, graph.needed)
        self._products(node.ends(local.summed, 0), local.key, summed, used, back)
        for i in range(node.copies if local.own else 0):
            values = Shared(each.start + i * each.size, each.size)
            self._products(node.ends(local.own, i), (local.key, "own"), values, used, back)

    def _evaluated(
        self, node: StageNode, ins: list[int], outs: list[int], needed: set[Number]
    ) -> tuple[Local, Shared, Each]:
        """Return a node's local derivatives, and their places: sums over its copies, and of each copy."""
        w, key = self.writer, (node.key, tuple(map(identity, node.sources)), tuple(ins), tuple(outs))
        if key not in self.known:
            numbers = [(n, k, x) for n in outs for k, x in enumerate(node.targets[n].numbers(0))]
            out_of = [(n, k) for n, k, x in numbers if node.copies > 1 or x in needed]
            local = local_jacobian(node, ins, out_of)
            summed, each = w.shared(len(local.summed)), w.each(node.copies, len(local.own))
            added: Target = summed if node.copies == 1 else w.start(summed, np.zeros(summed.size))
            kernel = w.kernel(("local", local.key), local.function, PART)
            w.call(kernel, node.copies, [node.sources[n] for n in local.read], [added, each])
            self.known[key] = local, summed, each
        return self.known[key]

    def _products(
        self,
        ends: list[tuple[Number, Number]],
        key: Any,
        values: Shared,
        used: set[Number],
        back: bool,
    ) -> None:
        """Add the products of derivatives with what is known on one side of them, for the other side.

        Args:
            ends: The numbers of source and target of each derivative.
            key: Equal keys mean equal derivatives.
            values: The derivatives.
            used: Numbers of sources that matter.
            back: Whether the targets' side is known.
        """
        pairs = [(k, *((y, x) if back else (x, y))) for k, (x, y) in enumerate(ends) if x in used]
        pairs = [pair for pair in pairs if pair[1] in self.of]
        if not pairs:
            return
        inputs = {x: i for i, x in enumerate(dict.fromkeys(known for _, known, _ in pairs))}
        outputs = {x: i for i, x in enumerate(dict.fromkeys(wanted for *_, wanted in pairs))}
        terms = tuple((k, inputs[known], outputs[wanted]) for k, known, wanted in pairs)
        reading = self.reading(list(inputs))
        function = partial(_sums, len(ends), reading, terms, len(outputs))
        w, place = self.writer, self.writer.own(self.lanes, len(outputs))
        kernel = w.kernel(("products", key, back, reading.key, terms), function, self.part)
        w.call(kernel, self.lanes, [values, *reading.blocks], [place])
        filled, known = np.zeros((self.lanes, len(outputs)), dtype=bool), self.pattern(list(inputs))
        for _, i, j in terms:
            filled[:, j] |= known[:, i]
        self.filled[place] = filled
        self.seed(list(outputs), place)
