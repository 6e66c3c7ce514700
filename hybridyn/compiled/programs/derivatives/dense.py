"""Products and eliminations of small dense matrices, one row or one column in each lane.

A matrix that all lanes read is stored for all of them, by rows or by columns.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from ...equations.expressions import Expression, dot, eye, pack, symbols
from ...program import Constants, Each, Own, Shared, Source, Target
from ..writer import Writer
from .sweeps import DENSE


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
    return end.size if isinstance(end, Own) else 0


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


def factors(n: int, rows: int) -> ca.Function:
    """Return the function of the factors of the first n columns of an (n, rows) matrix.

    They are symmetric positive definite, L diag L^T: L by rows below its diagonal, then the reciprocals of
    diag.
    """
    column, given = matrix("W", n, rows)
    W, L, reciprocals = given[:, :n].copy(), eye(n), []
    for i in range(n):
        reciprocals.append(1.0 / W[i, i])
        for j in range(i + 1, n):
            L[j, i] = W[j, i] * reciprocals[i]
            for c in range(i + 1, j + 1):
                W[j, c] = W[j, c] - L[j, i] * W[c, i]
    return ca.Function("pivot", [column], [pack(L[np.tril_indices(n, -1)], reciprocals)])


def solved(numbers: Expression, b: Expression) -> Expression:
    """Return x of W x = -b from the factors of W."""
    n, x = len(b), b.copy()
    L = eye(n)
    L[np.tril_indices(n, -1)] = numbers[: n * (n - 1) // 2]
    for i in range(1, n):
        x[i] = x[i] - dot(L[i, :i], x[:i])[()]
    x = -(x * numbers[n * (n - 1) // 2 :])
    for i in reversed(range(n - 1)):
        x[i] = x[i] - dot(L[i + 1 :, i], x[i + 1 :])[()]
    return x
