"""How the numbers in slots of a description change with parameters."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..spatial import Array, Mask
from ..structure.parameters.entries import Parameters

#: Imaginary step of functions that take complex numbers: no digit is lost.
COMPLEX_STEP = 1e-30
#: Largest step of a number of size one, and that of zero, of quotients of differences: files of xacro, and
#: parameters of other packages, have no derivatives.
QUOTIENT_STEP, STEP_AT_ZERO = 0.02, 1e-3
#: Quotients that are extrapolated, each of half the step of the one before. The error is
#: that of order 2 LEVELS: 1e-14 of a smooth expression; rounding counts for 1e-13.
LEVELS = 4


def changes_of(function: Callable[[Array], Array], at: Array, fixed: Mask | None = None) -> Array:
    """Return the derivative of rows of numbers over parameters, shape (numbers, k), by extrapolation.

    Args:
        function: From parameters, shape (n, k), to numbers, shape (n, numbers).
        at: The parameters, shape (k,).
        fixed: Which parameters are left out, shape (k,): their columns are zero.
    """
    step = np.where(at == 0.0, STEP_AT_ZERO, QUOTIENT_STEP * np.abs(at))
    chosen = np.arange(len(at)) if fixed is None else np.flatnonzero(~fixed)
    halves = 0.5 ** np.arange(LEVELS)
    rows = [at + sign * h * step[k] * np.eye(len(at))[k] for k in chosen for h in halves for sign in (1, -1)]
    found = function(np.array(rows).reshape(-1, len(at)))
    found = found.reshape(len(chosen), LEVELS, 2, found.shape[1])
    table = (found[:, :, 0] - found[:, :, 1]) / (2 * halves[:, None] * step[chosen, None, None])
    for level in range(1, LEVELS):
        table = table[:, 1:] + (table[:, 1:] - table[:, :-1]) / (4.0**level - 1.0)
    out = np.zeros((found.shape[3], len(at)))
    out[:, chosen] = table[:, 0].T
    return out


def slots_over_parameters(parameters: Parameters, p: Array) -> Array:
    """Return the derivative of the numbers in slots over parameters, shape (slots, k).

    Args:
        p: The parameters, shape (k,).

    Raises:
        ModelError: A xacro file is wrong, or has another structure, near these parameters.
    """
    exact = np.array([entry.analytic for entry in parameters.entries for _ in entry.labels], dtype=bool)
    out = np.zeros((len(parameters.slots), len(p)))
    if not exact.all():
        out = changes_of(parameters.slot_values, p, exact)
    row = column = 0
    for entry in parameters.entries:
        own = slice(column, column + entry.size)
        if entry.analytic:
            moved, _ = entry.numbers(p[own] + 1j * COMPLEX_STEP * np.eye(entry.size))
            out[row : row + len(entry.slots), own] = moved.imag.T / COMPLEX_STEP
        row, column = row + len(entry.slots), column + entry.size
    return out
