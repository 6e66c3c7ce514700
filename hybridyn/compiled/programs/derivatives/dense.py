"""Dense steps between the modules: factors of the mass matrix, solves, and products of rows with blocks.

Matrices over the modules' motions are kept in blocks of columns, one block for each module, with one row in
each lane. Right-hand sides are solved with one column in each lane.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import isqrt
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from ...equations.expressions import Expression, dot, eye, pack, symbols
from ...program import Constants, Each, Own, Shared, Source, Target
from ..writer import Writer
from .adjoints import PART, Pattern, block_size


class Term(NamedTuple):
    """Rows times a matrix.

    Attributes:
        rows: The rows.
        matrix: The matrix, for all lanes.
        pattern: Which of its entries are not always zero; None: all.
        by_columns: Whether it is kept column by column.
    """

    rows: Own
    matrix: Shared
    pattern: Pattern | None = None
    by_columns: bool = False


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


@dataclass(frozen=True)
class Factors:
    """Factors of a symmetric positive definite matrix M = L D L^T, block by block.

    Attributes:
        below: Rows of L under each block's diagonal block, for all lanes.
        own: L within each diagonal block, by rows below its diagonal, and then the reciprocals of D.
    """

    below: list[Shared]
    own: list[Shared]

    @property
    def sizes(self) -> tuple[int, ...]:
        """Number of columns of each block."""
        return tuple((isqrt(8 * own.size + 1) - 1) // 2 for own in self.own)


def factorise(w: Writer, blocks: list[Block]) -> Factors:
    """Add the calls that factorise a symmetric positive definite matrix by L D L^T, block by block.

    Args:
        w: The program under construction.
        blocks: The matrix; block j has as many columns as module j has motions.
    """
    rows, first = sum(block.rows.size for block in blocks), 0
    factors = Factors([], [])

    def kernel(make: Callable[..., ca.Function], *sizes: Any) -> int:
        """Return a kernel, which equal sizes share."""
        return w.kernel((make.__name__, *sizes), lambda: make(*sizes), PART)

    while blocks:
        n, others = blocks[0].rows.size, blocks[1:]
        own = w.shared(n * (n + 1) // 2)
        w.call(kernel(_pivot, n), 1, [blocks[0].some(first, n)], [own])
        lower, scaled, first = w.each(rows, n), w.own(rows, n), first + n
        factors.own.append(own)
        factors.below.append(Shared(lower.start + first * n, (rows - first) * n))
        if others:
            w.call(kernel(_below, n), rows, [blocks[0].rows, own], [lower, scaled])
            widths = tuple(block.rows.size for block in others)
            left = [new_block(w, rows, width) for width in widths]
            sources: list[Source] = [scaled, factors.below[-1], *(block.rows for block in others)]
            targets: list[Target] = [*(block.rows for block in left), left[0].all]
            w.call(kernel(_update, n, widths), rows, sources, targets)
            others = left
        blocks = others
    return factors


def _triangle(n: int, numbers: Expression) -> tuple[Expression, Expression]:
    """Return L within a diagonal block, and the reciprocals of D."""
    L = eye(n)
    L[np.tril_indices(n, -1)] = numbers[: n * (n - 1) // 2]
    return L, numbers[n * (n - 1) // 2 :]


def _pivot(n: int) -> ca.Function:
    """Return the factors of a diagonal block."""
    column, W = matrix("W", n, n)
    L, reciprocals = eye(n), []
    for i in range(n):
        reciprocals.append(1.0 / W[i, i])
        for j in range(i + 1, n):
            L[j, i] = W[j, i] * reciprocals[i]
            for c in range(i + 1, j + 1):
                W[j, c] = W[j, c] - L[j, i] * W[c, i]
    return ca.Function("pivot", [column], [pack(L[np.tril_indices(n, -1)], reciprocals)])


def _below(n: int) -> ca.Function:
    """Return a row of L under a diagonal block, and the same times D."""
    (row_column, row), (own_column, numbers) = symbols("row", n), symbols("own", n * (n + 1) // 2)
    L, reciprocals = _triangle(n, numbers)
    scaled = _forward(L, row)
    return ca.Function("below", [row_column, own_column], [pack(scaled * reciprocals), pack(scaled)])


def _update(n: int, widths: tuple[int, ...]) -> ca.Function:
    """Return what the elimination of a block leaves of a row of the others; the first of them twice."""
    (scaled_column, scaled), (below_column, below) = symbols("scaled", n), matrix("L", sum(widths), n)
    rows = [symbols("row", width) for width in widths]
    parts = np.split(below, np.cumsum(widths)[:-1])
    out = [pack(row - dot(L, scaled)) for (_, row), L in zip(rows, parts, strict=True)]
    return ca.Function("update", [scaled_column, below_column, *(c for c, _ in rows)], [*out, out[0]])


def _forward(L: Expression, b: Expression) -> Expression:
    """Solve L x = b for a unit lower triangle."""
    x = b.copy()
    for i in range(1, len(b)):
        x[i] = x[i] - dot(L[i, :i], x[:i])[()]
    return x


def solve(w: Writer, factors: Factors, right: Each, columns: int) -> list[Shared]:
    """Add the calls that solve M X = -B.

    Args:
        w: The program under construction.
        factors: Factors of M.
        right: The rows of B.
        columns: Number of columns of B.

    Returns:
        The rows of X that belong to each block, column by column.
    """
    sizes = factors.sizes
    n = sum(sizes)

    def transposed() -> ca.Function:
        """Return the columns of a matrix one after the other."""
        column, B = matrix("B", n, columns)
        return ca.Function("transposed", [column], [pack(B.T)])

    turned = w.shared(n * columns)
    kernel = w.kernel(("transposed", n, columns), transposed, PART)
    w.call(kernel, 1, [Shared(right.start, n * columns)], [turned])
    kernel = w.kernel(("solve", sizes), lambda: _solve(sizes), PART)
    out = [w.each(columns, size) for size in sizes]
    w.call(kernel, columns, [Each(turned.start, n), *factors.below, *factors.own], list(out))
    return [Shared(place.start, columns * place.size) for place in out]


def _solve(sizes: tuple[int, ...]) -> ca.Function:
    """Return -M^-1 b from the factors of M, in blocks."""
    n, first = sum(sizes), 0
    right, b = symbols("b", n)
    L = eye(n)
    reciprocals: list[Any] = []
    below, own = [], []
    for size in sizes:
        last = first + size
        column, L[last:, first:last] = matrix("below", n - last, size)
        below.append(column)
        column, numbers = symbols("own", size * (size + 1) // 2)
        L[first:last, first:last], D = _triangle(size, numbers)
        own.append(column)
        reciprocals.extend(-D)
        first = last
    x = _forward(L, b) * np.array(reciprocals)
    for i in reversed(range(n - 1)):
        x[i] = x[i] - dot(L[i + 1 :, i], x[i + 1 :])[()]
    return ca.Function(
        "solve", [right, *below, *own], [pack(part) for part in np.split(x, np.cumsum(sizes)[:-1])]
    )


def add_product(
    w: Writer,
    copies: int,
    terms: Sequence[Term],
    more: Sequence[Own | Constants],
    targets: list[Target],
) -> None:
    """Add the call that computes sum_i x_i B_i + sum_j y_j for each row.

    Args:
        w: The program under construction.
        copies: Number of rows.
        terms: Rows x_i and matrices B_i.
        more: Further rows y_j.
        targets: Targets of the result, which all receive it.
    """
    sizes = tuple((term.rows.size, term.matrix.size // term.rows.size) for term in terms)
    shapes = tuple(size[::-1] if term.by_columns else size for size, term in zip(sizes, terms, strict=True))
    patterns = tuple(None if term.pattern is None else term.pattern.tobytes() for term in terms)
    widths = tuple(map(block_size, more))
    key = ("product", sizes, tuple(term.by_columns for term in terms), patterns, widths, len(targets))

    def function() -> ca.Function:
        """Return the product."""
        rows = [symbols("x", n) for n, _ in sizes]
        matrices = [matrix("B", n, m) for n, m in shapes]
        others = [symbols("y", m) for m in widths]
        total: Any = 0.0
        for _, y in others:
            total = total + y
        for (_, x), (_, kept), term in zip(rows, matrices, terms, strict=True):
            B = kept.T if term.by_columns else kept
            total = total + dot(x, B if term.pattern is None else np.where(term.pattern, B, 0.0))
        columns = [column for part in (rows, matrices, others) for column, _ in part]
        return ca.Function("product", columns, [pack(total)] * len(targets))

    sources: list[Source] = [*(term.rows for term in terms), *(term.matrix for term in terms), *more]
    w.call(w.kernel(key, function, PART), copies, sources, targets)
