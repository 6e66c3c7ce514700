"""Arrays of expressions, see `symbols`: built from numbers, packed to columns, folded to one for many."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cache
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from ...spatial import Array, Index
from ...symbols import Expression, dot

#: Entries of constant rotations below this are rounding errors of cosines and sines.
ROTATION_ROUNDING = 4e-16
#: The same of products of several rotations, and of points in their axes, over the size of these.
TURNED_ROUNDING = 2e-15


def plain(values: Any) -> Expression:
    """Return numbers as an array of expressions."""
    return np.asarray(values, dtype=float).astype(object)


def numbers(values: Expression) -> Expression:
    """Convert numbers to expressions; expressions are returned unchanged."""
    return values if values.dtype == object else plain(values)


def settled(values: Expression) -> Expression:
    """Return an array of plain numbers, or the array itself if some entry is not constant."""
    entries = [float(x) if isinstance(x, ca.SX) and x.is_constant() else x for x in values.ravel()]
    if not any(isinstance(x, ca.SX) for x in entries):
        return np.array(entries, dtype=float).reshape(values.shape)
    return filled(entries, *values.shape)


def filled(entries: Sequence[Any], *shape: int) -> Expression:
    """Return an array of scalars, given row by row."""
    out = np.empty(len(entries), dtype=object)
    for i, entry in enumerate(entries):
        out[i] = entry
    return out.reshape(shape)


def zeros(*shape: int) -> Expression:
    """Return an array of zeros."""
    return plain(np.zeros(shape))


def eye(n: int) -> Expression:
    """Return a unit matrix."""
    return plain(np.eye(n))


def symbols(name: str, n: int) -> tuple[ca.SX, Expression]:
    """Return a column of symbols, and the same as an array of expressions, shape (n,)."""
    column = ca.SX.sym(name, n)
    return column, unpack(column)


def unpack(column: ca.SX) -> Expression:
    """Return the entries of a column, shape (n,)."""
    return filled(ca.densify(column).nonzeros(), column.numel())


def pack(*parts: Any) -> ca.SX:
    """Concatenate expressions, scalars and lists and arrays of them, to one dense column."""
    flat = [x for part in parts for x in _entries(part)]
    column = ca.vertcat(ca.SX(0, 1), *(x if isinstance(x, ca.SX) else ca.SX(x) for x in flat))
    return column if column.is_dense() else ca.densify(column)


def _entries(part: Any) -> list[Any]:
    """Return the scalars of an array or a list of them, or of one."""
    if isinstance(part, np.ndarray):
        entries: list[Any] = part.ravel().tolist()
        return entries
    return part if isinstance(part, list) else [part]


def sampled(M: Expression, columns: list[ca.SX], points: Iterable[Sequence[Array]]) -> Array:
    """Evaluate a matrix at points, numbers for each column of symbols, shape (points, *M.shape)."""
    (found,) = evaluated(ca.Function("sampled", columns, [pack(M)]), points)
    return found.reshape(len(found), *M.shape)


def evaluated(function: ca.Function, points: Iterable[Sequence[Array]]) -> list[Array]:
    """Evaluate a function of columns at points, numbers for each; return outputs, shapes (points, n)."""
    given = [np.stack(numbers, axis=1) for numbers in zip(*points, strict=True)]
    return [found.full().T for found in function.call(given)]


def pick(values: Expression, index: Index) -> Expression:
    """Return entries by index; index -1 gives zero (the entries of platforms are not read)."""
    return filled([values[i] if i >= 0 else 0.0 for i in index], len(index))


def along(n: Expression, x: Expression) -> Any:
    """Compute the scalar product of two vectors."""
    return dot(n, x[:, None])[0]


def congruence(B: Expression, M: Expression) -> Expression:
    """Compute B^T M B for symmetric M from one triangle."""
    return symmetric_product(B, dot(M, B))


def symmetric_product(A: Expression, B: Expression) -> Expression:
    """Compute A^T B, which is symmetric, from one triangle."""
    out = np.empty((A.shape[1], A.shape[1]), dtype=object)
    for i in range(len(out)):
        for j in range(i, len(out)):
            out[i, j] = out[j, i] = along(A[:, i], B[:, j])
    return out


def snap(R: NDArray[np.float64], rounding: float = ROTATION_ROUNDING) -> NDArray[np.float64]:
    """Round entries of a rotation to 0, 1 or -1 if they differ by rounding only; expressions stay."""
    if R.dtype == object:
        plain_entries = np.array([isinstance(x, float) for x in R.ravel()]).reshape(R.shape)
        out = R.copy()
        out[plain_entries] = snap(R[plain_entries].astype(float), rounding)
        return out
    out = np.where(np.abs(R) < rounding, 0.0, R)
    return np.where(np.abs(np.abs(out) - 1.0) < rounding, np.sign(out), out)


def snap_point(p: Array, size: float) -> Array:
    """Round coordinates of a point in axes that were turned to 0 if they are rounding; expressions stay.

    Args:
        size: Size of the points.
    """
    out = p.copy()
    out[[isinstance(x, float) and abs(x) < TURNED_ROUNDING * size for x in p.tolist()]] = 0.0
    return out


@cache
def _triangle(n: int) -> tuple[Index, Index]:
    """Return `triu_indices`, which takes longer than reading them."""
    return np.triu_indices(n)


def upper(M: Expression) -> Expression:
    """Return the upper triangle of a symmetric matrix, row by row."""
    return M[_triangle(len(M))]


def symmetric(entries: Expression, n: int) -> Expression:
    """Return a symmetric matrix from its upper triangle."""
    out = np.empty((n, n), dtype=object)
    rows, cols = _triangle(n)
    out[rows, cols] = entries
    out[cols, rows] = entries
    return out


#: Largest difference of equal numbers, relative to the largest of their array: a few roundings.
FOLDED_ALIKE = 8e-16


class Folding:
    """Collect the numbers in which copies of a leg differ, and those that are arguments of the model.

    Attributes:
        columns: Symbols so far.
        values: Their values, one array of shape (copies,) each; expressions where they are arguments.
    """

    def __init__(self) -> None:
        self.columns: list[ca.SX] = []
        self.values: list[Array] = []

    def array(self, copies: list[Array]) -> Expression:
        """Return an array of expressions that represents the arrays of all copies."""
        stacked = settled(np.stack([np.asarray(copy) for copy in copies]))
        shape, every = stacked.shape[1:], stacked.reshape(len(copies), -1)
        size = max((abs(x) for x in every.ravel().tolist() if not isinstance(x, ca.SX)), default=0.0)
        alone = every.dtype != object and (np.ptp(every, axis=0) <= FOLDED_ALIKE * size).all()
        entries = every[0].tolist() if alone else [self._one(settled(own), size) for own in every.T]
        return filled(entries, *shape)

    def _one(self, values: Expression, size: float) -> Any:
        """Return the expression of a number of all copies, which equal and opposite numbers share."""
        constant = values.dtype != object
        if constant and np.ptp(values) <= FOLDED_ALIKE * size:
            return float(values[0])
        for column, known in zip(self.columns, self.values, strict=True):
            if known.dtype != values.dtype:
                continue
            if (known == values).all() if constant else all(map(_equal, known, values)):
                return column
            if constant and (known == -values).all():
                return -column
        self.columns.append(ca.SX.sym(f"number_{len(self.columns)}"))
        self.values.append(values)
        return self.columns[-1]

    def symbol(self) -> ca.SX:
        """Return all symbols as one column."""
        return ca.vertcat(*self.columns) if self.columns else ca.SX(0, 1)

    def table(self, copies: int) -> Array:
        """Return the copies' numbers, shape (copies, symbols); an object array if some are arguments."""
        return np.array(self.values).T.reshape(copies, len(self.values))


def _equal(x: Any, y: Any) -> bool:
    """Return whether two scalars are the same expression."""
    return bool(ca.is_equal(ca.SX(x), ca.SX(y)))


def scalar(x: Any) -> Expression:
    """Return a number, which may be an expression, as an array of shape (1,)."""
    out = np.empty(1, dtype=object)
    out[0] = x
    return settled(out)
