"""Dense steps between the modules: the inverse of the mass matrix, and products of rows with blocks.

Matrices over the modules' motions are kept in blocks of columns, one block for each module, with one row in
each lane.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np

from ...equations.expressions import Expression, dot, eye, pack, symbols
from ...equations.static_elimination import solve_definite
from ...program import Constants, Each, Own, Shared, Source, Target
from ..writer import Writer
from .adjoints import PART, Pattern, block_size

#: Rows, a matrix for all lanes, and which of its entries are not always zero (None: all).
Term = tuple[Own, Shared, Pattern | None]


@dataclass(frozen=True)
class Block:
    """A block of columns.

    Attributes:
        rows: Its rows in lanes.
        all: Its rows one after the other, for all lanes.
        pattern: Which entries are not always zero; None where that is not known.
    """

    rows: Own
    all: Each
    pattern: Pattern | None = None

    def some(self, first: int, count: int) -> Shared:
        """Return some rows for all lanes."""
        return Shared(self.all.start + first * self.all.size, count * self.all.size)


def new_block(w: Writer, rows: int, columns: int) -> Block:
    """Allocate a block."""
    return Block(w.own(rows, columns), w.each(rows, columns))


def matrix(name: str, rows: int, columns: int) -> tuple[ca.SX, Expression]:
    """Return symbols of a matrix, as a column and as a matrix."""
    column, entries = symbols(name, rows * columns)
    return column, entries.reshape(rows, columns)


def inverse(w: Writer, blocks: list[Block]) -> list[Block]:
    """Add the calls that invert a symmetric positive definite matrix by Gauss-Jordan steps, block by block.

    Args:
        w: The program under construction.
        blocks: The matrix; block j has as many columns as module j has motions.

    Returns:
        The inverse, in such blocks.
    """
    sizes = [block.rows.size for block in blocks]
    rows, first = sum(sizes), 0
    for size in sizes:
        pivot = _pivot_rows(w, blocks, first)
        after = [new_block(w, rows, block.rows.size) for block in (*blocks[1:], blocks[0])]
        mine = np.zeros((rows, size))
        mine[first : first + size] = np.eye(size)
        others = 1.0 - mine.sum(axis=1, keepdims=True)
        constants: list[Source] = [Constants(mine), Constants(others)]
        widths = tuple(block.rows.size for block in blocks)

        def function(widths: tuple[int, ...] = widths) -> ca.Function:
            """Return one step of Gauss and Jordan for one row."""
            n = widths[0]
            (mine_col, mine), (others_col, others) = symbols("mine", n), symbols("others", 1)
            own = [symbols("row", width) for width in widths]
            pivots = [matrix("pivot", n, width) for width in widths]
            factor = mine - dot(own[0][1][:, None], others)
            pairs = zip(own[1:], pivots[1:], strict=True)
            out = [dot(x[:, None], others) + dot(factor, P) for (_, x), (_, P) in pairs]
            out.append(dot(factor, pivots[0][1]))
            columns = [mine_col, others_col, *(c for c, _ in own), *(c for c, _ in pivots)]
            return ca.Function("step", columns, [pack(x) for x in out for _ in range(2)])

        targets: list[Target] = [place for block in after for place in (block.rows, block.all)]
        sources = [*constants, *(block.rows for block in blocks), *pivot]
        w.call(w.kernel(("step", widths), function, PART), rows, sources, targets)
        blocks, first = after, first + size
    return blocks


def _pivot_rows(w: Writer, blocks: list[Block], first: int) -> list[Shared]:
    """Add the call that solves the rows of the first block for its unknowns: their rows, over the others."""
    widths = tuple(block.rows.size for block in blocks)
    n = widths[0]

    def function() -> ca.Function:
        """Return the rows of the pivots, solved."""
        columns, values = zip(*(matrix("rows", n, width) for width in widths), strict=True)
        right = np.concatenate([eye(n), *values[1:]], axis=1)
        X, _ = solve_definite(values[0], right, 1.0)
        ends = np.cumsum([0, *widths])
        return ca.Function("pivot", columns, [pack(X[:, a:b]) for a, b in pairwise(ends)])

    places = [w.shared(n * width) for width in widths]
    sources: list[Source] = [block.some(first, n) for block in blocks]
    w.call(w.kernel(("pivot", widths), function, PART), 1, sources, list(places))
    return places


def add_product(
    w: Writer,
    copies: int,
    terms: Sequence[Term],
    more: Sequence[Own | Constants],
    targets: list[Target],
    sign: float = 1.0,
) -> None:
    """Add the call that computes `sign` sum_i x_i B_i + sum_j y_j for each row.

    Args:
        w: The program under construction.
        copies: Number of rows.
        terms: Rows x_i, matrices B_i, and which entries of B_i are not always zero (None: all).
        more: Further rows y_j.
        targets: Targets of the result, which all receive it.
        sign: 1.0 or -1.0.
    """
    sizes = tuple((x.size, B.size // x.size) for x, B, _ in terms)
    patterns = tuple(None if pattern is None else pattern.tobytes() for *_, pattern in terms)
    widths = tuple(map(block_size, more))
    key = ("product", sizes, patterns, widths, len(targets), sign)

    def function() -> ca.Function:
        """Return the product."""
        rows = [symbols("x", n) for n, _ in sizes]
        matrices = [matrix("B", n, m) for n, m in sizes]
        others = [symbols("y", m) for m in widths]
        total: Any = 0.0
        for _, y in others:
            total = total + y
        for (_, x), (_, B), (*_, pattern) in zip(rows, matrices, terms, strict=True):
            total = total + dot(x, B if pattern is None else np.where(pattern, B, 0.0)) * sign
        columns = [column for part in (rows, matrices, others) for column, _ in part]
        return ca.Function("product", columns, [pack(total)] * len(targets))

    sources: list[Source] = [*(x for x, *_ in terms), *(B for _, B, _ in terms), *more]
    w.call(w.kernel(key, function, PART), copies, sources, targets)
