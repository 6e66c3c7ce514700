"""Fold the numbers of several equal legs: equal numbers become constants, the others inputs of the code."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from ...spatial import Array
from .expressions import Expression, numbers, settled

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
        out = np.empty(stacked.shape[1:], dtype=object)
        for at in np.ndindex(*out.shape):
            values = settled(stacked[(slice(None), *at)])
            out[at] = self._argument(values) if values.dtype == object else self._scalar(values, size)
        return out

    def _argument(self, values: Expression) -> ca.SX:
        """Return the symbol of a number that is an argument in some copies; equal numbers share one."""
        for column, known in zip(self.columns, self.values, strict=True):
            if known.dtype == object and all(
                ca.is_equal(ca.SX(x), ca.SX(y)) for x, y in zip(values, known, strict=True)
            ):
                return column
        self.columns.append(ca.SX.sym(f"number_{len(self.columns)}"))
        self.values.append(values)
        return self.columns[-1]

    def _scalar(self, values: Array, size: float) -> Any:
        """Return one expression that represents a number of all copies."""
        if np.ptp(values) <= FOLDED_ALIKE * size:
            return float(values[0])
        for column, known in zip(self.columns, self.values, strict=True):
            if known.dtype == object:
                continue
            if (known == values).all():
                return column
            if (known == -values).all():
                return -column
        column = ca.SX.sym(f"number_{len(self.columns)}")
        self.columns.append(column)
        self.values.append(values)
        return column

    def symbol(self) -> ca.SX:
        """Return all symbols as one column."""
        return ca.vertcat(*self.columns) if self.columns else ca.SX(0, 1)

    def table(self, copies: int) -> Array:
        """Return the copies' numbers, shape (copies, symbols); an object array if some are arguments."""
        return np.array(self.values).T.reshape(copies, len(self.values))


def scalar(x: Any) -> Expression:
    """Return a number, which may be an expression, as an array of shape (1,)."""
    out = np.empty(1, dtype=object)
    out[0] = x
    return settled(out)
