"""Traced numbers of records as expressions."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields, is_dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

from .traced import Traced


def numbers_of(value: Any) -> Any:
    """Return a record with its traced numbers as expressions.

    Args:
        value: A record, a tuple, an array or a number, whose parts may be `Traced` with CasADi expressions.
            Arrays without any become plain numbers.
    """
    if isinstance(value, Traced):
        expression = ca.SX(value.expression)
        return float(expression) if expression.is_constant() else expression
    if is_dataclass(value) and not isinstance(value, type):
        return replace(value, **{x.name: numbers_of(getattr(value, x.name)) for x in fields(value)})
    if isinstance(value, tuple):
        parts = map(numbers_of, value)
        return value._make(parts) if hasattr(value, "_make") else tuple(parts)
    if not isinstance(value, np.ndarray) or value.dtype != object:
        return value
    out = np.empty(value.shape, dtype=object)
    for at in np.ndindex(*value.shape):
        out[at] = numbers_of(value[at])
    return out if any(isinstance(x, ca.SX) for x in out.ravel()) else out.astype(float)


def depends(value: Any) -> bool:
    """Return whether some number of a record is an expression."""
    return any(
        isinstance(x, ca.SX) or (isinstance(x, np.ndarray) and x.dtype.hasobject) for x in _parts(value)
    )


def _parts(value: Any) -> Iterator[Any]:
    """Yield the numbers, arrays and words of a record."""
    if is_dataclass(value):
        value = tuple(getattr(value, x.name) for x in fields(value))
    if not isinstance(value, tuple):
        yield value
        return
    for part in value:
        yield from _parts(part)
