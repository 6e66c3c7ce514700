"""Guards: detect samples that a compiled model hands to the general path.

A guard is at most 1 where the compiled model can be trusted. It exceeds 1 if a pivot becomes small that is
large at generic postures, or if positions or rates leave the loops open by more than rounding. There the
compiled model loses digits, and the general path computes the sample or raises the error.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca

from .expressions import Expression, is_zero
from .static_elimination import TRUSTED_PIVOT

#: Largest closure residual relative to the module's length (or a radian), and of rates relative to their
#: size: ten thousand roundings of the model's arithmetic.
GUARD_CLOSED = {"float64": 1e-11, "float32": 3e-3}


@dataclass(frozen=True)
class Scale:
    """Scales of closure residuals.

    Attributes:
        length: The module's length, [m].
        closed: One of `GUARD_CLOSED`.
    """

    length: float
    closed: float


#: Added to rates to avoid 0 / 0; smaller than any rate that matters.
TINY_RATE = 1e-290


def trusted(trust: ca.SX) -> Any:
    """Return the guard of a pivot that is `trust` times its usual size."""
    return 2.0 - trust / TRUSTED_PIVOT


def loops_closed(
    positions: list[tuple[Expression, float]],
    rates: list[tuple[Expression, float]],
    speed: Any,
    closed: float,
) -> Any:
    """Compute the guard of closures.

    Args:
        positions: Position residuals, each with its unit.
        rates: Rate residuals, each with its unit.
        speed: Size of the module's rates (`size_of`).
        closed: Largest relative residual, one of `GUARD_CLOSED`.
    """
    worst: Any = ca.SX(0.0)
    for values, unit in positions:
        worst = ca.fmax(worst, largest(values) / (closed * unit))
    for values, unit in rates:
        worst = ca.fmax(worst, largest(values) / (closed * unit * (speed + TINY_RATE)))
    return worst


def accelerating_apart(values: Expression, size: Any, closed: float) -> Any:
    """Compute the guard of acceleration residuals.

    Args:
        values: Residuals, without units.
        size: Size of the module's accelerations, including its squared speed.
        closed: Largest relative residual, one of `GUARD_CLOSED`.
    """
    if all(is_zero(x) for x in values):
        return ca.SX(0.0)
    return largest(values) / (closed * (size + TINY_RATE))


def size_of(joints: Expression, units: Any, motions: list[Expression], length: float) -> Any:
    """Compute the size of rates (or accelerations) of joints and of 6-D motions, without units."""
    size: Any = 0.0
    for value, unit in zip(joints, units, strict=True):
        if not is_zero(value):
            size = size + ca.fabs(value) * (1.0 / unit)
    for motion in motions:
        for k, value in enumerate(motion):
            if not is_zero(value):
                size = size + ca.fabs(value) * (1.0 / length if k < 3 else 1.0)
    return size


def largest(values: Expression) -> Any:
    """Compute the largest absolute value."""
    out: Any = ca.SX(0.0)
    for value in values.ravel():
        if not is_zero(value):
            out = ca.fmax(out, ca.fabs(value))
    return out
