"""Solve for friction that answers to what it changes: n = N(p_0 + B n) of the joints of one module.

Newton's method begins at N(p_0). It is judged by what it reaches: with L[i, j] = N_i(column j of B) and any
weights x > 0, the ratio rho = max (L x)_i / x_i bounds how far frictions feed on one another. Below 1 there
is one solution, and N is nearer to it than rho / (1 - rho) of the largest residual r = |N_i - n_i| / x_i, in
the same measure. If that is more than rounding explains, the guard hands the sample to the general path.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from typing import Any

import casadi as ca
import numpy as np

from ...effects.load_friction import direction, length
from ...spatial import numpy_on_symbols
from ...symbols import Expression, dot, is_zero, plus, times
from .expressions import eye, filled, zeros
from .guarded_elimination import Triangular
from .rubbing import WrenchAnswers
from .rubbing_joints import Rubbing, terms_of

#: Steps of Newton's method. A step leaves about the square of the error; the first has that of the ratio.
NEWTON = 3
#: Part of a friction's weight, over the rounding of one number, that the bound of its error may be.
SETTLED = 256.0
#: Part of a friction in its weight: a joint whose load does not change counts by its own friction.
OWN_PART = 0.25
#: What makes weights positive where nothing loads a joint, also in single precision.
NO_LOAD = 1e-30


def settle(rubbing: Sequence[Rubbing], found: WrenchAnswers, eps: float) -> tuple[Expression, Any]:
    """Solve for the friction of each joint; return it, shape (joints,), and its guard.

    Args:
        rubbing: The joints.
        found: What the law takes from their wrenches.
        eps: Rounding of one number.
    """
    n = friction_of(rubbing, found.alone)
    if all(is_zero(x) for B in found.per_unit for x in B.ravel()):
        return n, 0.0
    for _ in range(NEWTON):
        n = newton_step(rubbing, _under(found, n), found.per_unit, n)
    N = friction_of(rubbing, _under(found, n))
    columns = [[B[:, [j]] for B in found.per_unit] for j in range(len(rubbing))]
    L = np.stack([friction_of(rubbing, [B[:, 0] for B in one]) for one in columns], axis=1)
    x = weights(N, dot(L, N))
    return N, far_from_solution(largest_over(dot(L, x), x), largest_over(N - n, x), eps)


def weights(n: Expression, change: Expression) -> Expression:
    """Return weights of frictions: a part of them, and a bound of what they change of one another."""
    return np.array([OWN_PART * x + y + NO_LOAD for x, y in zip(n, change, strict=True)], dtype=object)


def far_from_solution(ratio: Any, residual: Any, eps: float) -> Any:
    """Return a guard that exceeds 1 if frictions may be further from the solution than rounding explains.

    Args:
        ratio: Bound of how much frictions feed on one another.
        residual: Largest residual of a friction over its weight.
        eps: Rounding of one number.
    """
    error = ratio * residual / ((1.0 - ratio) * SETTLED * eps)
    return ca.if_else(ratio < 1.0, error * error, np.inf)


def largest_over(values: Expression, weights: Expression) -> Any:
    """Return the largest of some numbers over their weights, infinity where one is NaN, which fmax drops."""
    parts = [ca.fabs(y) / x for y, x in zip(values, weights, strict=True)]
    return ca.if_else(sum(parts) < np.inf, reduce(ca.fmax, parts), np.inf)


def _under(found: WrenchAnswers, n: Expression) -> list[Expression]:
    """Return what the law takes under friction n, for each term."""
    return [plus(p, dot(B, n)) for p, B in zip(found.alone, found.per_unit, strict=True)]


def friction_of(rubbing: Sequence[Rubbing], parts: Sequence[Expression]) -> Expression:
    """Compute the friction of each joint from what each term takes, shape (joints,).

    Of changes of that it is a bound of the change of friction.
    """
    N = zeros(len(rubbing))
    for (i, factor, _), part in zip(terms_of(rubbing), parts, strict=True):
        with numpy_on_symbols():
            N[i] = plus(N[i], times(factor, length(part)))
    return N


def newton_step(
    rubbing: Sequence[Rubbing], parts: Sequence[Expression], per_unit: Sequence[Expression], n: Expression
) -> Expression:
    """Take a step of Newton's method, shape (joints,).

    Args:
        rubbing: The joints.
        parts: What each term takes under frictions n.
        per_unit: How that answers to the frictions, shape (rows, joints) each.
        n: The frictions.
    """
    N, slope = friction_of(rubbing, parts), zeros(len(rubbing), len(rubbing))
    for (i, factor, _), part, B in zip(terms_of(rubbing), parts, per_unit, strict=True):
        with numpy_on_symbols():
            way = direction(part)
        along = filled([times(factor, x) for x in way], len(way))
        slope[i] = plus(slope[i], dot(along, B))
    return n + Triangular.of_square(eye(len(n)) - slope).solve((N - n)[:, None])[:, 0]
