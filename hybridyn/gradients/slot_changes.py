"""How the numbers in slots of a description change with parameters."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.polynomial import chebyshev

from ..spatial import Array, Mask
from ..structure.parameters.chosen import Parameters
from ..structure.parameters.entries import Numbers

#: Imaginary step of functions that take complex numbers: no digit is lost.
COMPLEX_STEP = 1e-30
#: Half the interval of a polynomial through numbers without derivatives (files of xacro, parameters of other
#: packages), as a part of a parameter's size, or of its range where it is zero; and that without a range. A
#: range may be many times as wide as its least number, near which 1 / p bends.
PART, STEP_AT_ZERO = 0.02, 1e-3
#: Points in the interval: the error is that of order 8, 1e-14 of a smooth expression; rounding, 1e-13.
POINTS = 8
#: Rounding of a number over its change in half the interval from which it takes the interval of zero: a
#: parameter may be zero but for rounding, beside a number that is not.
NOISE = 1e-11


def changes_of(
    function: Callable[[Array], Numbers], at: Array, ranges: Array | None = None, fixed: Mask | None = None
) -> Array:
    """Return the derivative of rows of numbers over parameters, shape (numbers, k), by polynomials.

    Where a range ends, or numbers beyond are not possible, all points lie on one side.

    Args:
        function: From parameters, shape (n, k), to numbers, shape (n, numbers), and errors by row.
        at: The parameters, shape (k,).
        ranges: Their lower and upper bounds, shape (k, 2), infinite where there are none.
        fixed: Which parameters are left out, shape (k,): their columns are zero.

    Raises:
        ModelError: Numbers are not possible at the parameters, or on both sides of one.
    """
    values = _possible(function(at[None]))[0]
    bounds = np.tile([-np.inf, np.inf], (len(at), 1)) if ranges is None else ranges
    widths = np.where(np.isfinite(bounds).all(axis=1), np.ptp(bounds, axis=1), 0.0)
    at_zero = np.where(widths > 0.0, PART * widths, STEP_AT_ZERO)
    steps = np.where(at == 0.0, at_zero, PART * np.abs(at))
    low, high = np.minimum(bounds[:, 0], at), np.maximum(bounds[:, 1], at)
    rounding = np.finfo(float).eps
    out = np.zeros((len(values), len(at)))
    for k in range(len(at)) if fixed is None else np.flatnonzero(~fixed).tolist():

        def slopes(step: float, k: int = k) -> Array:
            """Return the derivative over one parameter, from an interval within its bounds."""
            ends = max(low[k], at[k] - step), min(high[k], at[k] + step)
            return _slopes(function, at, k, ends)

        out[:, k] = slopes(steps[k])
        noisy = rounding * np.abs(values) > NOISE * steps[k] * np.abs(out[:, k])
        if noisy.any() and rounding > NOISE * steps[k]:
            out[noisy, k] = slopes(at_zero[k])[noisy]
    return out


def _slopes(function: Callable[[Array], Numbers], at: Array, k: int, ends: tuple[float, float]) -> Array:
    """Return the derivative of numbers over one parameter, shape (numbers,), from an interval."""
    points = chebyshev.chebpts1(POINTS)
    rows = np.tile(at, (POINTS, 1))
    rows[:, k] = 0.5 * (ends[0] + ends[1] + (ends[1] - ends[0]) * points)
    found, errors = function(rows)
    beyond = {bool(rows[i, k] > at[k]) for i in errors}
    if len(beyond) == 1 and ends[0] < at[k] < ends[1]:
        side = (ends[0], float(at[k])) if True in beyond else (float(at[k]), ends[1])
        return _slopes(function, at, k, side)
    changes = _possible((found - found[0], errors))
    place = (2 * at[k] - ends[0] - ends[1]) / (ends[1] - ends[0])
    rates = [chebyshev.chebval(place, chebyshev.chebder(one)) for one in np.eye(POINTS)]
    weights = np.linalg.solve(chebyshev.chebvander(points, POINTS - 1).T, rates)
    out: Array = 2 * weights @ changes / (ends[1] - ends[0])
    return out


def _possible(numbers: Numbers) -> Array:
    """Return numbers of which no row is an error."""
    values, errors = numbers
    if errors:
        raise errors[min(errors)]
    return values


def slots_over_parameters(parameters: Parameters, p: Array) -> Array:
    """Return the derivative of the numbers in slots over parameters, shape (slots, k).

    Args:
        p: The parameters, shape (k,).

    Raises:
        ModelError: A xacro file is wrong, or has another structure, at these parameters or on both sides of
            one.
    """
    exact = np.array([entry.analytic for entry in parameters.entries for _ in entry.labels], dtype=bool)
    out = np.zeros((len(parameters.slots), len(p)))
    if not exact.all():
        out = changes_of(parameters.possible, p, fixed=exact)
    row = column = 0
    for entry in parameters.entries:
        own = slice(column, column + entry.size)
        if entry.analytic:
            moved, _ = entry.numbers(p[own] + 1j * COMPLEX_STEP * np.eye(entry.size))
            out[row : row + len(entry.slots), own] = moved.imag.T / COMPLEX_STEP
        row, column = row + len(entry.slots), column + entry.size
    return out
