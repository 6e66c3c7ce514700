"""Bound how much frictions of modules feed on one another, by the energy of what they accelerate.

Accelerations a that friction causes have an energy a^T M a. It splits among the modules: with I_o, the
articulated inertia on output o, and I that on which the module stands, which is no less than its own,

    sum of |V_dot_o|^2 in I_o  <=  |V_dot|^2 in I + |u|^2 in A_t

So what moves the base loses size on its way to the outputs, and biases lose size inwards, in the norms of the
inverse inertias. Sizes of a few vectors then lead from frictions to what the law takes, whatever the number
of modules and whatever the axes and units of V_dot:

    bias of the base  <=  sum of |inward| n + b,       b^2 = sum of |beta_o|^2
    |u|  <=  w = sum of |forced| n + b,                |V_dot_o|^2  <=  |V_dot|^2 + w^2
    |p|  <=  |of_base| |V_dot| + |of_u| w + sum of |of_z| |beta_o| + |of_z| n
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import casadi as ca
import numpy as np

from ...symbols import Expression, dot, is_zero, plus
from .expressions import along, filled, zeros
from .factors import Definite, Handed
from .scales import squares

#: Least pivot of an inertia, of its diagonal entry over the rounding of one number: a hundredth of it is
#: certain then.
CERTAIN_PIVOT = 1e3


def measured(
    answers: Mapping[str, Expression], base: Expression | None, outputs: Sequence[Expression], eps: float
) -> tuple[Handed, Any]:
    """Measure how a module answers, by energies; return the sizes, and the guard of the inertia of the base.

    Args:
        answers: How it answers (`rubbing_moving`).
        base: Inertia of what it stands on with all that this carries, shape (6, 6), or None.
        outputs: Articulated inertia of each output that carries others, shape (6, 6).
        eps: Rounding of one number.
    """
    of_u, of_z, forced = (answers[name] for name in ("of_u", "of_z", "forced"))
    A_t = Definite(answers["lower"], answers["inverses"])
    sizes = {"of_u": A_t.lengths(of_u.T), "forced": A_t.lengths(forced)}
    sizes["of_z"] = zeros(len(of_z), len(outputs))
    for o, inertia in enumerate(outputs):
        for row, x in enumerate(of_z[:, 6 * o : 6 * o + 6]):
            if not all(map(is_zero, x)):
                sizes["of_z"][row, o] = ca.sqrt(ca.fmax(along(x, dot(inertia, x)), 0.0))
    if base is None:
        return Handed(**sizes), 0.0
    factors, guard = Definite.certain(base, CERTAIN_PIVOT * eps)
    sizes |= {"of_base": factors.lengths(answers["of_base"].T), "inward": factors.lengths(answers["inward"])}
    return Handed(**sizes), guard


def bias_within(sizes: Mapping[str, Expression], beta: Expression, n: Expression) -> Any:
    """Bound the bias of a module's base.

    Args:
        sizes: How it answers.
        beta: Sizes of the biases of its outputs.
        n: Frictions of its joints.
    """
    return plus(along(sizes["inward"], n), length_of(beta))


def motion_within(
    sizes: Mapping[str, Expression], base: Any, beta: Expression, n: Expression
) -> tuple[Any, Any]:
    """Bound V_dot of a module's outputs, and u; `base` is the size of V_dot of its base."""
    w = plus(along(sizes["forced"], n), length_of(beta))
    return length_of(np.array([base, w], dtype=object)), w


def taken_within(
    sizes: Mapping[str, Expression], of_n: Expression, known: tuple[Any, Any], beta: Expression, n: Expression
) -> Expression:
    """Bound what the law takes of a module's joints, shape (rows,).

    Args:
        sizes, beta, n: As of `bias_within`.
        of_n: The columns of n of `of_z`.
        known: Sizes of V_dot of its base, and of u.
    """
    absolute = filled([0.0 if is_zero(x) else ca.fabs(x) for x in of_n.ravel()], *of_n.shape)
    out: Expression = plus(dot(absolute, n), dot(sizes["of_z"], beta))
    for name, size in zip(("of_base", "of_u"), known, strict=True):
        if name in sizes:
            out = plus(out, dot(sizes[name][:, None], np.array([size], dtype=object)))
    return out


def length_of(x: Expression) -> Any:
    """Return the length of a vector, one number as it is."""
    parts = [entry for entry in x if not is_zero(entry)]
    return ca.sqrt(squares(x)) if len(parts) > 1 else parts[0] if parts else 0.0
