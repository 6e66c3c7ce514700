"""Guards: detect samples that a compiled model hands to the general path.

A guard is at most 1 where the compiled model can be trusted. It exceeds 1 if a pivot becomes small that is
large at generic postures, or if positions or rates leave the loops open by more than rounding. There the
compiled model loses digits, and the general path computes the sample or raises the error.

A guard is a sum of squares, each of a number over its limit. So it exceeds 1 as soon as one number exceeds
its limit, it is NaN if one number is, and it needs two operations a number and no branch.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from .expressions import Expression, is_zero, plus, times

#: Largest closure residual relative to the module's length (or a radian), and of rates relative to their
#: size: ten thousand roundings of the model's arithmetic.
GUARD_CLOSED = {"float64": 1e-11, "float32": 3e-3}
#: Largest closure residual, as part of what rounding in the file leaves in redundant loops.
OF_ROUNDED = 10.0
#: Largest such rounding. The models meet some rows and leave the others open by it, the general path balances
#: all of them: where loops contradict each other by more, the difference is no longer rounding of the file.
COARSE_FILE = 1e-6
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
    """

    length: float
    closed: float
    tiny: float = TINY_RATE["float64"]
    compared: bool = True

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
    out: Any = ca.SX(0.0)
    for value in values.ravel():
        out = plus(out, times(value, value))
    return out


def weighed(residuals: list[tuple[Expression, float]], weight: Any) -> Any:
    """Compute the guard of closure residuals.

    Args:
        residuals: Residuals, each with its unit.
        weight: Weight of their squares without units (`Scale.weight`, `Scale.weight_of_positions`).
    """
    total: Any = ca.SX(0.0)
    for values, unit in residuals:
        total = plus(total, times(squares(values), times(weight, 1.0 / unit**2)))
    return total


def size_of(joints: Expression, units: Any, motions: list[Expression], length: float) -> Any:
    """Compute the size of rates (or accelerations) of joints and of 6-D motions, without units."""
    size: Any = 0.0
    per = [*(1.0 / np.asarray(units)), *([1.0 / length] * 3 + [1.0] * 3) * len(motions)]
    for value, weight in zip(np.concatenate([joints, *motions]), per, strict=True):
        if not is_zero(value):
            size = plus(size, times(ca.fabs(value), weight))
    return size


def largest(values: Expression) -> Any:
    """Compute the largest absolute value."""
    out: Any = ca.SX(0.0)
    for value in values.ravel():
        if not is_zero(value):
            out = ca.fmax(out, ca.fabs(value))
    return out
