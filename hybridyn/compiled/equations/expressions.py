"""Linear algebra on expressions: NumPy object arrays of floats and CasADi scalars.

Products with zeros and ones are simplified, so that unit axes and empty blocks generate no code.
"""

from __future__ import annotations

import functools
import operator
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from ...spatial import Array

Expression = NDArray[Any]  # of float or casadi.SX scalars

#: Entries of constant rotations below this are rounding errors of cosines and sines.
ROTATION_ROUNDING = 4e-16


def is_zero(x: Any) -> bool:
    """Return whether a scalar is known to be zero."""
    return bool(x.is_zero()) if isinstance(x, ca.SX) else x == 0


def times(x: Any, y: Any) -> Any:
    """Multiply two scalars; the product is the float 0 if a factor is known to be zero."""
    return 0.0 if is_zero(x) or is_zero(y) else _times(x, y)


def _operator(of_symbols: int, of_numbers: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    """Return an operator of two scalars; CasADi's own takes eight times longer, to find out what they are."""

    def apply(x: Any, y: Any) -> Any:
        """Apply the operator."""
        known = not (isinstance(x, ca.SX) or isinstance(y, ca.SX))
        return of_numbers(x, y) if known else ca.SX.binary(of_symbols, x, y)

    return apply


_times = _operator(ca.OP_MUL, operator.mul)
_plus, _minus = _operator(ca.OP_ADD, operator.add), _operator(ca.OP_SUB, operator.sub)


def plus(x: Any, y: Any) -> Any:
    """Add two scalars or two arrays; the operator of CasADi's scalars takes eight times longer."""
    return _added(x, y) if isinstance(x, np.ndarray) else _plus(x, y)


def minus(x: Any, y: Any) -> Any:
    """Subtract two scalars or two arrays, as `plus` adds them."""
    return _subtracted(x, y) if isinstance(x, np.ndarray) else _minus(x, y)


_added, _subtracted = np.frompyfunc(_plus, 2, 1), np.frompyfunc(_minus, 2, 1)


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
    return filled([column[i] for i in range(column.numel())], column.numel())


def pack(*parts: Any) -> ca.SX:
    """Concatenate expressions to one dense column."""
    flat = [x for part in parts for x in np.asarray(part, dtype=object).ravel()]
    return ca.densify(ca.vertcat(*[ca.SX(x) for x in flat])) if flat else ca.SX(0, 1)


def sampled(M: Expression, columns: list[ca.SX], points: Iterable[Sequence[Array]]) -> Array:
    """Evaluate a matrix at points, numbers for each column of symbols, shape (points, *M.shape)."""
    function = ca.Function("sampled", columns, [pack(M)])
    return np.array([np.array(function(*numbers)).reshape(M.shape) for numbers in points])


def along(n: Expression, x: Expression) -> Any:
    """Compute the scalar product of two vectors."""
    return dot(n, x[:, None])[0]


def dot(A: Expression, B: Expression) -> Expression:
    """Multiply matrices or vectors, shapes as for `A @ B`."""
    left = A if A.ndim == 2 else A[None]
    right = B if B.ndim == 2 else B[:, None]
    out = np.empty((left.shape[0], right.shape[1]), dtype=object)
    columns = [{k: y for k, y in enumerate(right[:, j]) if not is_zero(y)} for j in range(out.shape[1])]
    for i in range(out.shape[0]):
        row = [(k, x) for k, x in enumerate(left[i]) if not is_zero(x)]
        for j, column in enumerate(columns):
            products = [_times(x, column[k]) for k, x in row if k in column]
            out[i, j] = functools.reduce(_plus, products) if products else 0.0
    if A.ndim == 1:
        out = out[0]
    return out[..., 0] if B.ndim == 1 else out


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


def cross(a: Expression, b: Expression) -> Expression:
    """Compute the vector product a x b, shape (3,)."""
    pairs = (1, 2), (2, 0), (0, 1)
    return np.array([_minus(times(a[i], b[j]), times(a[j], b[i])) for i, j in pairs], dtype=object)


def hat(a: Expression) -> Expression:
    """Return the matrix of a x, shape (3, 3)."""
    out = zeros(3, 3)
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        out[i, j], out[j, i] = -a[k], a[k]
    return out


def snap(R: NDArray[np.float64]) -> NDArray[np.float64]:
    """Round entries of a rotation to 0, 1 or -1 if they differ by rounding only; expressions stay."""
    if R.dtype == object:
        plain_entries = np.array([isinstance(x, float) for x in R.ravel()]).reshape(R.shape)
        out = R.copy()
        out[plain_entries] = snap(R[plain_entries].astype(float))
        return out
    out = np.where(np.abs(R) < ROTATION_ROUNDING, 0.0, R)
    return np.where(np.abs(np.abs(out) - 1.0) < ROTATION_ROUNDING, np.sign(out), out)


def upper(M: Expression) -> Expression:
    """Return the upper triangle of a symmetric matrix, row by row."""
    return M[np.triu_indices(len(M))]


def symmetric(entries: Expression, n: int) -> Expression:
    """Return a symmetric matrix from its upper triangle."""
    out = np.empty((n, n), dtype=object)
    rows, cols = np.triu_indices(n)
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
        stacked = settled(np.stack([numbers(np.asarray(copy)) for copy in copies]))
        plain_values = [abs(x) for x in stacked.ravel() if not isinstance(x, ca.SX)]
        size = np.max(plain_values, initial=0.0)
        shape = stacked.shape[1:]
        entries = [self._one(settled(stacked[(slice(None), *at)]), size) for at in np.ndindex(*shape)]
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
