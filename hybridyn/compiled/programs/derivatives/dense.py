"""Products and eliminations of small dense matrices, one row or one column in each lane.

A matrix that all lanes read is stored for all of them, by rows or by columns.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np

from ....spatial import Mask
from ...equations.expressions import Expression, dot, eye, pack, symbols
from ...program import Each, Own, Shared, Source, Target
from ..writer import Writer
from .sweeps import DENSE


def matrix(name: str, rows: int, columns: int) -> tuple[ca.SX, Expression]:
    """Return symbols of a matrix, as a column and as a matrix."""
    column, entries = symbols(name, rows * columns)
    return column, entries.reshape(rows, columns)


#: A matrix for all lanes, stored column by column, and the column that it is multiplied with in each lane.
Term = tuple[Shared, Own | Each]


def by_columns(all: Each, first: int, count: int) -> Shared:
    """Return some columns of a matrix that is stored column by column, for all lanes."""
    return Shared(all.start + first * all.size, count * all.size)


def add_terms(
    w: Writer,
    copies: int,
    size: int,
    terms: Sequence[Term],
    more: Sequence[Source],
    target: Target,
    mapped: tuple[Each, Mask] | None = None,
    after: Sequence[Source] = (),
) -> None:
    """Add the call that writes sum_i A_i x_i + sum_j y_j, one column in each lane.

    Args:
        w: The program under construction.
        copies: Number of columns.
        size: Number of rows of the result.
        terms: The matrices A_i and the columns x_i.
        more: The columns y_j.
        target: Target of the result.
        mapped: A matrix that the sum is multiplied with, column by column; its transposed pattern.
        after: Columns that are added to this product.
    """
    widths, given = [column.size for _, column in terms], [end for term in terms for end in term]
    rows, mask = (size, None) if mapped is None else (len(mapped[1]), mapped[1])
    sources = [*given, *more, *([] if mapped is None else [by_columns(mapped[0], 0, rows)]), *after]

    def function() -> ca.Function:
        """Return the sum."""
        total: Any = np.zeros(rows).astype(object)
        columns: list[ca.SX] = []
        for width in widths:
            (kept, A), (column, x) = matrix("A", width, rows), symbols("x", width)
            total = total + dot(A.T, x)
            columns += [kept, column]
        for _ in more:
            column, y = symbols("y", rows)
            total = total + y
            columns.append(column)
        if mask is not None:
            kept, A = matrix("mapped", *mask.shape)
            total = dot(np.where(mask, A, 0.0).T, total)
            columns.append(kept)
        for _ in after:
            column, y = symbols("y", size)
            total = total + y
            columns.append(column)
        return ca.Function("columns", columns, [pack(total)])

    if size:
        pattern = None if mask is None else mask.tobytes()
        key = ("columns", tuple(widths), rows, size, len(more), pattern, len(after))
        w.call(w.kernel(key, function, DENSE), copies, sources, [target])


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
