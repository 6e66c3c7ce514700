"""Sums and products of arrays of symbols: NumPy object arrays of floats and CasADi scalars.

Products with zeros and ones are simplified, so that unit axes and empty blocks generate no code. `spatial`
leads here where it is given such arrays.
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
from casadi import SX
from numpy.typing import NDArray

Expression = NDArray[Any]  # of float or casadi.SX scalars

# CasADi's own operators take eight times longer than `binary`, to find out what they are given. A number
# takes `binary` as long as its operation, and most numbers are zeros and ones, which need none.
_binary, _MUL, _ADD, _SUB = SX.binary, ca.OP_MUL, ca.OP_ADD, ca.OP_SUB

_CODES = {"cos": ca.OP_COS, "sin": ca.OP_SIN, "sqrt": ca.OP_SQRT, "arctan2": ca.OP_ATAN2}


def is_zero(x: Any) -> bool:
    """Return whether a scalar is known to be zero."""
    return bool(x.is_zero() if isinstance(x, SX) else x == 0)


def _times(x: Any, y: Any) -> Any:
    """Multiply two scalars, as `times` does."""
    if isinstance(x, SX):
        if isinstance(y, SX):
            return _binary(_MUL, x, y)
        return x if y == 1 else _binary(_MUL, x, y) if y else 0.0
    if isinstance(y, SX):
        return y if x == 1 else _binary(_MUL, x, y) if x else 0.0
    return x * y if x and y else 0.0


def _plus(x: Any, y: Any) -> Any:
    """Add two scalars, as `plus` does."""
    if isinstance(x, SX):
        return _binary(_ADD, x, y) if isinstance(y, SX) or y else x
    if isinstance(y, SX):
        return _binary(_ADD, x, y) if x else y
    return x + y


def _minus(x: Any, y: Any) -> Any:
    """Subtract two scalars, as `minus` does."""
    if isinstance(x, SX):
        return _binary(_SUB, x, y) if isinstance(y, SX) or y else x
    if isinstance(y, SX):
        return _binary(_SUB, x, y) if x else SX.unary(ca.OP_NEG, y)
    return x - y


_added, _subtracted, _product = (np.frompyfunc(f, 2, 1) for f in (_plus, _minus, _times))


def times(x: Any, y: Any) -> Any:
    """Multiply two scalars or two arrays; a product is the float 0 if a factor is the number zero."""
    return _product(x, y) if isinstance(x, np.ndarray) else _times(x, y)


def plus(x: Any, y: Any) -> Any:
    """Add two scalars or two arrays."""
    return _added(x, y) if isinstance(x, np.ndarray) else _plus(x, y)


def minus(x: Any, y: Any) -> Any:
    """Subtract two scalars or two arrays."""
    return _subtracted(x, y) if isinstance(x, np.ndarray) else _minus(x, y)


def by_entry(name: str, *x: Expression) -> Expression:
    """Apply a function of CasADi or NumPy, "cos" or "arctan2", to the entries of arrays."""
    code = _CODES[name]

    def function(*given: Any) -> Any:
        """Apply it to scalars."""
        if not any(isinstance(one, SX) for one in given):
            return getattr(np, name)(*given)
        return SX.unary(code, *given) if len(given) == 1 else _binary(code, *given)

    applied: Expression = np.frompyfunc(function, len(x), 1)(*x)
    return applied


def dot(A: Expression, B: Expression) -> Expression:
    """Multiply matrices or vectors, shapes as for `A @ B`."""
    left = A.tolist() if A.ndim == 2 else [A.tolist()]
    right = B.T.tolist() if B.ndim == 2 else [B.tolist()]
    columns = [[(isinstance(y, SX) or bool(y), y) for y in column] for column in right]
    out = np.empty((len(left), len(right)), dtype=object)
    for i, entries in enumerate(left):
        row = [(k, x) for k, x in enumerate(entries) if isinstance(x, SX) or x]
        for j, column in enumerate(columns):
            total: Any = None
            for k, x in row:
                known, y = column[k]
                if known:
                    product = _times(x, y)
                    total = product if total is None else _plus(total, product)
            out[i, j] = 0.0 if total is None else total
    if A.ndim == 1:
        out = out[0]
    return out[..., 0] if B.ndim == 1 else out


def compose(A: Expression, B: Expression) -> Expression:
    """Multiply matrices, shapes (..., m, k) and (..., k, n)."""
    batch = np.broadcast_shapes(A.shape[:-2], B.shape[:-2])
    if not batch:
        return dot(A, B)
    out = np.empty((*batch, A.shape[-2], B.shape[-1]), dtype=object)
    left, right = (np.broadcast_to(x, (*batch, *x.shape[-2:])) for x in (A, B))
    for at in np.ndindex(*batch):
        out[at] = dot(left[at], right[at])
    return out


def cross(a: Expression, b: Expression) -> Expression:
    """Compute a x b along the last axis, shapes (..., 3)."""
    out = np.empty(np.broadcast_shapes(a.shape, b.shape), dtype=object)
    if out.ndim == 1:
        (x, y, z), (u, v, w) = a.tolist(), b.tolist()
        out[0] = _minus(_times(y, w), _times(z, v))
        out[1] = _minus(_times(z, u), _times(x, w))
        out[2] = _minus(_times(x, v), _times(y, u))
        return out
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        out[..., i : i + 1] = _subtracted(
            _product(a[..., j : j + 1], b[..., k : k + 1]), _product(a[..., k : k + 1], b[..., j : j + 1])
        )
    return out
