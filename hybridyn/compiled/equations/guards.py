"""When a written-out model hands a sample to the general path.

A guard is at most 1 where the written-out model may be trusted. It rises above 1 where a pivot gets small
that was large at generic postures, and where positions or rates leave the loops open by more than rounding:
there both models still agree on what is asked, but no longer to the last digits, and the general one words
the error.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca

from .expressions import Expression, is_zero
from .static_elimination import TRUSTED_PIVOT

#: Loops may be open by this part of the module's length (or a radian), and rates slip by this part of theirs:
#: ten thousand roundings of the numbers that a model computes with.
GUARD_CLOSED = {"float64": 1e-11, "float32": 3e-3}


@dataclass(frozen=True)
class Scale:
    """What closures are measured by.

    Attributes:
        length: The module's length, [m].
        closed: One of `GUARD_CLOSED`.
    """

    length: float
    closed: float


#: Keeps 0 / 0 from being asked; smaller than any rate that matters.
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
    """Return the guard of closures.

    Args:
        positions: What must vanish, and its unit.
        rates: What must vanish, and its unit.
        speed: Size of the module's rates (`size_of`).
        closed: `GUARD_CLOSED`.
    """
    worst: Any = ca.SX(0.0)
    for values, unit in positions:
        worst = ca.fmax(worst, largest(values) / (closed * unit))
    for values, unit in rates:
        worst = ca.fmax(worst, largest(values) / (closed * unit * (speed + TINY_RATE)))
    return worst


def accelerating_apart(values: Expression, size: Any, closed: float) -> Any:
    """Return the guard of accelerations that must agree.

    Args:
        values: What must vanish, without units.
        size: Size of the module's accelerations, speed squared among it.
        closed: `GUARD_CLOSED`.
    """
    if all(is_zero(x) for x in values):
        return ca.SX(0.0)
    return largest(values) / (closed * (size + TINY_RATE))


def size_of(joints: Expression, units: Any, motions: list[Expression], length: float) -> Any:
    """Return the size of rates (or accelerations) without units, of joints and of 6-D motions."""
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
    """Return the largest absolute value."""
    out: Any = ca.SX(0.0)
    for value in values.ravel():
        if not is_zero(value):
            out = ca.fmax(out, ca.fabs(value))
    return out
