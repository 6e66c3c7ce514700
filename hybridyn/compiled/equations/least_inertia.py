"""What certainly is an inertia along each motion."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from ...symbols import Expression, is_zero, plus, times
from .expressions import along, zeros
from .module_plan import ModulePlan
from .scales import squares

#: Ratio of an inertia to what it is the difference of, below which accelerations lose more than five digits:
#: of a pivot to its diagonal entry, and of this to the inertia with all other joints locked (of the first
#: axis of a gimbal-locked wrist of light links).
NEARLY_NO_INERTIA = 1e-5

#: Inertia along a motion, over that of the joints that take part about all axes, that is certainly one, in
#: roundings.
CERTAIN = 5000.0
#: Largest growth of the rounding of a motion's inertia in the accelerations of others, by the square of their
#: coupling over this inertia: to 1e-10.
AMPLIFIED = 5e5


def least_inertia(
    plan: ModulePlan, Psi: Expression, M_yy: Expression, A_t: Expression
) -> tuple[Expression, Any]:
    """Compute what certainly is an inertia along each motion, where arguments change inertias.

    It is a part of the inertias of the joints that take part; that about one axis is a difference of those
    about all. Idle motions are decided by their own numbers.

    Returns:
        These inertias, shape (motions,), and the guard that their rounding does not grow in other motions.
    """
    turned = plan.mechanism.turned_inertia[plan.parts.tree_v]
    joints = np.array([plus(x, float(y)) for x, y in zip(np.diag(M_yy), turned, strict=True)], dtype=object)
    least, growth = zeros(len(A_t)), zeros(len(A_t))
    for k in range(plan.idle, len(A_t)):
        terms = along(np.array([times(x, x) for x in Psi[:, k]], dtype=object), joints)
        least[k] = times(CERTAIN * plan.scale.eps, terms)
        others = [j for j in range(len(A_t)) if j != k and not is_zero(A_t[k, j])]
        coupled = sum((A_t[k, j] * A_t[k, j] / A_t[j, j] for j in others), ca.SX(0.0))
        growth[k] = terms * coupled / (AMPLIFIED * A_t[k, k] * A_t[k, k])
    return least, squares(growth)
