"""When a written-out model hands a sample to the general path.

A guard is at most 1 where the written-out model may be trusted. It rises above 1 where a pivot gets small that was
large at generic postures, and where positions or rates leave the loops open by more than rounding: there both
models still agree on what is asked, but no longer to the last digits, and the general one words the error.
"""

from __future__ import annotations

from typing import Any

import casadi as ca

from .expressions import Expression, is_zero
from .static_elimination import TRUSTED

#: Loops may be open by this part of the module's length (or a radian), and rates slip by this part of theirs.
CLOSED = 1e-11
#: Keeps 0 / 0 from being asked; smaller than any rate that matters.
NOTHING = 1e-290


def trusted(trust: ca.SX) -> Any:
    """Give the guard of a pivot that is `trust` times its usual size."""
    return 2.0 - trust / TRUSTED


def closed(positions: list[tuple[Expression, float]], rates: list[tuple[Expression, Expression]]) -> Any:
    """Give the guard of closures.

    Args:
        positions: What must vanish, and its unit.
        rates: What must vanish, and the rates that it is a difference of.
    """
    worst: Any = ca.SX(0.0)
    for values, unit in positions:
        worst = ca.fmax(worst, largest(values) / (CLOSED * unit))
    for values, parts in rates:
        size: Any = NOTHING
        for part in parts:
            if not is_zero(part):
                size = size + ca.fabs(part)
        worst = ca.fmax(worst, largest(values) / (CLOSED * size))
    return worst


def largest(values: Expression) -> Any:
    """Give the largest absolute value."""
    out: Any = ca.SX(0.0)
    for value in values.ravel():
        if not is_zero(value):
            out = ca.fmax(out, ca.fabs(value))
    return out


def accelerating_apart(values: Expression, sizes: Expression) -> Any:
    """Give the guard of accelerations that must agree.

    Args:
        values: What must vanish.
        sizes: The accelerations that it is a difference of.
    """
    if all(is_zero(x) for x in values):
        return ca.SX(0.0)
    size: Any = NOTHING
    for part in sizes:
        if not is_zero(part):
            size = size + ca.fabs(part)
    return largest(values) / (CLOSED * size)
