"""Guards of arguments: they detect arguments that give a robot another structure."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca

from ..expressions import Expression, dot
from ..guards import largest
from .traced import Decision

#: Guard where arguments decide the structure otherwise.
OTHER_STRUCTURE = 2.0


def decided_alike(decisions: Sequence[Decision]) -> ca.SX:
    """Return a guard above 1 where some comparison has another outcome than at the nominal arguments."""
    guard = ca.SX(0.0)
    for one in decisions:
        holds = one.compare(ca.SX(one.left), ca.SX(one.right))
        alike = holds if one.outcome else ca.logic_not(holds)
        guard = ca.fmax(guard, ca.if_else(alike, 0.0, OTHER_STRUCTURE))
    return guard


def dependence(K: Expression, Psi: Expression, closed: float) -> Any:
    """Return the guard that closure rows without a pivot still depend on the others.

    Args:
        K: Closure rows without units, shape (rows, n).
        Psi: Motions without units that the rows with pivots allow, shape (n, motions).
        closed: Largest relative residual, one of `guards.GUARD_CLOSED`.
    """
    return largest(dot(K, Psi)) / (closed * (1.0 + largest(Psi)))
