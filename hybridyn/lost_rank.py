"""What to do where a module's closures lose rank: a constraint singularity, such as a four-bar lying flat.

Mobility belongs to the module and never changes with the posture; at such a posture more motions than that
are possible for an instant. A single freedom that is moving says itself which of them the mechanism is on.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .errors import SingularityError
from .module import Module
from .reduction import Basis
from .spatial import Array

#: A smallest pivot below this part of the largest is rounding: the row is lost at that posture.
LOST = 1e-13


def refuse_lost_rank(module: Module, basis: Basis) -> None:
    """Refuse samples at which a module's closures lose rank.

    Raises:
        SingularityError: Naming module, sample and condition number.
    """
    lost = np.flatnonzero(basis.pivot < LOST)
    if not len(lost) or not module.mechanism.reduction.rank:
        return
    t = int(lost[0])
    condition = float(1 / basis.pivot[t]) if basis.pivot[t] > 0 else np.inf
    raise SingularityError(
        f"module '{module.name}': its closures lose rank at sample {t} (constraint singularity; condition "
        f"number {condition:.1e}, limit {1 / LOST:.0e}): more than its {module.mobility} freedoms are "
        "possible there for an instant. Move the posture away from it, or, for the inverse model, pass "
        'on_singular="least-norm"',
        module=module.name,
        what="closures",
        condition=condition,
        sample=t,
    )


def along_motion(module: Module, basis: Basis, x_dot: Array) -> Basis:
    """Give the motions at postures of lost rank: for one freedom that moves, the motion that it makes.

    Args:
        module: The module.
        basis: Its motions as the elimination gave them.
        x_dot: Its rates, shape (T, n).
    """
    lost = np.flatnonzero((basis.pivot < LOST) & x_dot.any(axis=1))
    if not len(lost) or module.mobility != 1:
        return basis
    unit = module.mechanism.reduction.col_scale
    Psi = basis.Psi.copy()
    speed = np.linalg.norm(x_dot[lost] / unit, axis=1)
    Psi[lost, :, 0] = x_dot[lost] / speed[:, None]
    return replace(basis, Psi=Psi)
