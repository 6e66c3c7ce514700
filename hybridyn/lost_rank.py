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
#: From this near on, the digits are counted that a small pivot leaves.
NEAR = 1e-6


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


def refuse_lost_digits(module: Module, basis: Basis, Q: Array, size: Array, weight: float) -> None:
    """Refuse efforts that are nothing but rounding next to a constraint singularity.

    A motion that is not one of the smooth ones there needs accelerations of the order of 1 / pivot, and
    closure wrenches of 1 / pivot again: the efforts are what is left of terms that cancel.

    Args:
        module: The module.
        basis: Its motions.
        Q: Generalised force needed along each motion, shape (T, N), [N m].
        size: Largest term that Q was summed from, shape (T,), [N m].
        weight: Effort that the robot's weight makes at most [N m]: rounding below it does no harm.

    Raises:
        SingularityError: Naming module, sample and condition number.
    """
    rounding = np.finfo(float).eps * size
    kept = np.maximum(np.abs(Q).max(axis=1, initial=0.0), weight) * basis.pivot
    bad = np.flatnonzero((basis.pivot >= LOST) & (basis.pivot < NEAR) & (rounding > kept))
    if not len(bad) or not module.motors:
        return
    t = int(bad[0])
    condition = float(1 / basis.pivot[t]) if basis.pivot[t] > 0 else np.inf
    raise SingularityError(
        f"module '{module.name}': no digit of its efforts is left at sample {t}, next to a constraint "
        f"singularity (condition number {condition:.1e}): terms of {size[t]:.1e} N m cancel. Such "
        "accelerations are not those of a smooth motion there; take q, v, a of one that is, or move the "
        "posture away",
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
