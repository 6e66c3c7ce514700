"""Products and eliminations of small dense matrices, one row or one column in each lane.

A matrix that all lanes read is stored for all of them, by rows or by columns.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from ...equations.expressions import Expression, dot, eye, pack, symbols
from ...program import Constants, Each, Own, Shared, Source, Target, Turned
from ..writer import Writer
from .adjoints import DENSE, PART, Pattern


@dataclass(frozen=True)
class Block:
    """A matrix.

    Attributes:
        rows: Its rows in lanes.
        all: Its rows one after the other, for all lanes.
        pattern: Which entries are not always zero; None where that is not known.
    """

    rows: Own
    all: Each
    pattern: Pattern | None = None


def new_block(w: Writer, rows: int, columns: int) -> Block:
    """Allocate a matrix."""
    return Block(w.own(rows, columns), w.each(rows, columns))


def matrix(name: str, rows: int, columns: int) -> tuple[ca.SX, Expression]:
    """Return symbols of a matrix, as a column and as a matrix."""
    column, entries = symbols(name, rows * columns)
    return column, entries.reshape(rows, columns)


class Term(NamedTuple):
    """A matrix times a column.

    Attributes:
        matrix: The matrix, for all lanes, stored column by column.
        column: The column, one in each lane.
        size: Number of entries of the column.
    """

    matrix: Shared
    column: Source
    size: int


def by_columns(all: Each, first: int, count: int) -> Shared:
    """Return some columns of a matrix that is stored column by column, for all lanes."""
    return Shared(all.start + first * all.size, count * all.size)


def add_terms(
    w: Writer, copies: int, terms: Sequence[Term], more: Sequence[Source], *targets: Target
) -> None:
    """Add the call that writes sum_i A_i x_i + sum_j y_j to each of the targets, one column in each lane."""
    sizes = tuple((term.matrix.size // term.size, term.size) for term in terms)

    def function() -> ca.Function:
        """Return the sum."""
        total, columns = sum_of(sizes, sizes[0][0], len(more))
        return ca.Function("columns", columns, [pack(total)] * len(targets))

    kernel = w.kernel(("columns", sizes, len(more), len(targets)), function, DENSE)
    w.call(kernel, copies, [*sources_of(terms), *more], list(targets))


def copy_columns(w: Writer, count: int, source: Source, target: Target) -> None:
    """Add the call that copies columns, or writes constants."""
    size = int(source.values.shape[1]) if isinstance(source, Constants) else width_of(source)

    def function() -> ca.Function:
        """Return a column as it is."""
        column, x = symbols("x", size)
        return ca.Function("copy", [column], [pack(x)])

    if size and count:
        w.call(w.kernel(("copy", size), function, DENSE), count, [source], [target])


def width_of(end: Source | None) -> int:
    """Return how many numbers a column of own numbers has."""
    return end.rows if isinstance(end, Turned) else end.size if isinstance(end, Own) else 0


def sources_of(terms: Sequence[Term]) -> list[Source]:
    """Return the sources of terms in the order of `sum_of`."""
    return [source for term in terms for source in (term.matrix, term.column)]


def sum_of(sizes: Sequence[tuple[int, int]], rows: int, more: int) -> tuple[Expression, list[ca.SX]]:
    """Return sum_i A_i x_i + sum_j y_j, and the columns of symbols in it."""
    total: Any = np.zeros(rows).astype(object)
    columns: list[ca.SX] = []
    for shape in sizes:
        (kept, A), (column, x) = matrix("A", *shape[::-1]), symbols("x", shape[1])
        total = total + dot(A.T, x)
        columns += [kept, column]
    for _ in range(more):
        column, y = symbols("y", rows)
        total = total + y
        columns.append(column)
    return total, columns


@dataclass(frozen=True)
class Elimination:
    """Elimination of a group's motions.

    Attributes:
        factors: L of D = L diag L^T by rows below its diagonal, and then the reciprocals of diag.
        E: The wrench on the base over the motions, row by row.
        motions: Number of motions.
        rows: Number of motions, and six if there is a wrench on the base.
    """

    factors: Shared
    E: Shared
    motions: int
    rows: int

    @classmethod
    def of(cls, w: Writer, over_u: Each, rows: int) -> Elimination:
        """Factorise the upper rows of a matrix, which are symmetric positive definite.

        Args:
            w: The program under construction.
            over_u: The remaining forces, and below them the wrench on the base, over the motions.
            rows: Number of rows of both.
        """
        n = over_u.size
        factors = w.shared(n * (n + 1) // 2)
        if n:
            kernel = w.kernel(("pivot", n), lambda: _pivot(n), PART)
            w.call(kernel, 1, [Shared(over_u.start, n * n)], [factors])
        return cls(factors, Shared(over_u.start + n * n, (rows - n) * n), n, rows)

    def columns(self, w: Writer, count: int, right: Source, motion: Target, wrench: Target | None) -> None:
        """Add the call that solves for the motions that columns cause, u = -D^-1 r.

        Args:
            w: The program under construction.
            count: Number of columns.
            right: The columns [r; F].
            motion: Target of u.
            wrench: Target of F + E u; None if there is no wrench.
        """
        kernel = w.kernel(("eliminate", self.motions, self.rows), self._function, PART)
        w.call(kernel, count, [right, self.factors, self.E], [motion, *([wrench] if wrench else [])])

    def _function(self) -> ca.Function:
        """Return the function of `columns`."""
        n = self.motions
        (right, b), (factors, numbers) = symbols("b", self.rows), symbols("factors", self.factors.size)
        E_column, E = matrix("E", self.rows - n, n)
        L = eye(n)
        L[np.tril_indices(n, -1)] = numbers[: n * (n - 1) // 2]
        x = b[:n].copy()
        for i in range(1, n):
            x[i] = x[i] - dot(L[i, :i], x[:i])[()]
        x = -(x * numbers[n * (n - 1) // 2 :])
        for i in reversed(range(n - 1)):
            x[i] = x[i] - dot(L[i + 1 :, i], x[i + 1 :])[()]
        outputs = [pack(x), pack(b[n:] + dot(E, x))] if self.rows > n else [pack(x)]
        return ca.Function("eliminate", [right, factors, E_column], outputs)


def _pivot(n: int) -> ca.Function:
    """Return the factors of a symmetric matrix."""
    column, W = matrix("W", n, n)
    L, reciprocals = eye(n), []
    for i in range(n):
        reciprocals.append(1.0 / W[i, i])
        for j in range(i + 1, n):
            L[j, i] = W[j, i] * reciprocals[i]
            for c in range(i + 1, j + 1):
                W[j, c] = W[j, c] - L[j, i] * W[c, i]
    return ca.Function("pivot", [column], [pack(L[np.tril_indices(n, -1)], reciprocals)])
