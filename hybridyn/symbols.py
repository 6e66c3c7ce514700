"""Sums and products of arrays of symbols: NumPy object arrays of floats and CasADi scalars.

Products with zeros and ones are simplified, so that unit axes and empty blocks generate no code. `spatial`
leads here where it is given such arrays.
"""

from __future__ import annotations

import functools
import operator
from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
from casadi import SX
from numpy.typing import NDArray

Expression = NDArray[Any]  # of float or casadi.SX scalars


def is_zero(x: Any) -> bool:
    """Return whether a scalar is known to be zero."""
    return bool(x.is_zero() if isinstance(x, SX) else x == 0)


def times(x: Any, y: Any) -> Any:
    """Multiply two scalars or two arrays; a product is the float 0 if a factor is known to be zero."""
    return _product(x, y) if isinstance(x, np.ndarray) else _of_two(x, y)


def _of_two(x: Any, y: Any) -> Any:
    """Multiply two scalars, as `times` does."""
    return 0.0 if is_zero(x) or is_zero(y) else _times(x, y)


def _operator(of_symbols: int, of_numbers: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    """Return an operator of two scalars; CasADi's own takes eight times longer, to find out what they are."""

    def apply(x: Any, y: Any) -> Any:
        """Apply the operator."""
        symbols = isinstance(x, SX) or isinstance(y, SX)
        return SX.binary(of_symbols, x, y) if symbols else of_numbers(x, y)

    return apply


_times = _operator(ca.OP_MUL, operator.mul)
_plus, _minus = _operator(ca.OP_ADD, operator.add), _operator(ca.OP_SUB, operator.sub)


def plus(x: Any, y: Any) -> Any:
    """Add two scalars or two arrays; the operator of CasADi's scalars takes eight times longer."""
    return _added(x, y) if isinstance(x, np.ndarray) else _plus(x, y)


def minus(x: Any, y: Any) -> Any:
    """Subtract two scalars or two arrays, as `plus` adds them."""
    return _subtracted(x, y) if isinstance(x, np.ndarray) else _minus(x, y)


_added, _subtracted, _product = (np.frompyfunc(f, 2, 1) for f in (_plus, _minus, _of_two))


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
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        out[..., i : i + 1] = _subtracted(
            _product(a[..., j : j + 1], b[..., k : k + 1]), _product(a[..., k : k + 1], b[..., j : j + 1])
        )
    return out
