"""Derivatives over parameters, from those over the numbers in slots."""

from __future__ import annotations

import numpy as np

from ..spatial import Array
from ..structure.parameters.chosen import Parameters
from .adjoint import ClosedAdjoint
from .blocks import Factored
from .samples import Samples
from .slot_changes import slots_over_parameters

#: Largest residual, in lengths of modules, that a unit of a number may open dependent rows by: rounding.
OPENED_ALONE = 1e-6


def over_parameters(
    parameters: Parameters,
    closed: ClosedAdjoint,
    over: Array,
    at: Samples,
    factors: list[Factored],
    along: Array | None = None,
) -> Array:
    """Return derivatives over parameters, shape (..., k); NaN where a loop opens.

    Args:
        parameters: The parameters.
        closed: The rows of loops.
        over: Derivatives over slots, shape (..., slots).
        at: The samples.
        factors: Their rows of loops.
        along: Derivative of the parameters over numbers that move them together, shape (k, n), or None.
    """
    slots = slots_over_parameters(parameters, at.p)
    slots = slots if along is None else slots @ along
    out: Array = over @ slots
    if factors:
        opened = closed.opening(factors, at.numbers, slots)
        out[..., np.abs(opened).max(axis=0, initial=0.0) > OPENED_ALONE] = np.nan
    return out
