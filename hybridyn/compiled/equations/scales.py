"""Scales of residuals, and the guards that weigh squared residuals by them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce
from typing import Any

import casadi as ca
import numpy as np

from ...symbols import Expression, is_zero, plus, times

#: Largest closure residual relative to the module's length (or a radian), and of rates relative to their
#: size: ten thousand roundings of the model's arithmetic.
GUARD_CLOSED = {"float64": 1e-11, "float32": 3e-3}
#: Largest closure residual, as part of what rounding in the file leaves in redundant loops.
OF_ROUNDED = 10.0
#: Added to rates to avoid 0 / 0; smaller than any rate that matters, and squares of limits stay numbers.
TINY_RATE = {"float64": 1e-140, "float32": 1e-16}


@dataclass(frozen=True)
class Scale:
    """Scales of closure residuals.

    Attributes:
        length: The module's length, [m].
        closed: One of `GUARD_CLOSED`.
        tiny: One of `TINY_RATE`.
        compared: Whether guards compare both ends of each loop; False where the loops have just been closed.
        eps: Rounding of the arithmetic.
    """

    length: float
    closed: float
    tiny: float = TINY_RATE["float64"]
    compared: bool = True
    eps: float = float(np.finfo("float64").eps)

    def weight(self, size: Any) -> Any:
        """Compute the weight of squared residuals of rates, or accelerations, of a given size."""
        per = 1.0 / (self.closed * (size + self.tiny))
        return per * per

    @property
    def weight_of_positions(self) -> float:
        """Weight of squared residuals of positions."""
        return 1.0 / self.closed**2


def squares(values: Expression) -> Any:
    """Compute the sum of the squares of values."""
    return reduce(plus, (times(value, value) for value in values.ravel()), ca.SX(0.0))


def weighed(residuals: list[tuple[Expression, float]], weight: Any) -> Any:
    """Compute the guard of closure residuals.

    Args:
        residuals: Residuals, each with its unit.
        weight: Weight of their squares without units (`Scale.weight`, `Scale.weight_of_positions`).
    """
    own = (times(squares(values), times(weight, 1.0 / unit**2)) for values, unit in residuals)
    return reduce(plus, own, ca.SX(0.0))


def size_of(joints: Expression, units: Any, motions: list[Expression], length: float) -> Any:
    """Compute the size of rates (or accelerations) of joints and of 6-D motions, without units."""
    per = [*(1.0 / np.asarray(units)), *([1.0 / length] * 3 + [1.0] * 3) * len(motions)]
    pairs = zip(np.concatenate([joints, *motions]), per, strict=True)
    return reduce(plus, (times(ca.fabs(x), weight) for x, weight in pairs if not is_zero(x)), 0.0)


def largest(values: Expression) -> Any:
    """Compute the largest absolute value."""
    return reduce(ca.fmax, (ca.fabs(x) for x in values.ravel() if not is_zero(x)), ca.SX(0.0))
