"""Handle postures at which a module's closures lose rank (constraint singularities, as in a flat four-bar).

The mobility is a property of the module and does not depend on the posture. At a constraint singularity, more
motions than the mobility are instantaneously possible. The velocity determines the branch that the mechanism
follows (`branch.py`). At rest the motors must balance the forces along all these motions.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..errors import SingularityError
from ..linkage.reduction import Basis
from ..manifold.branch import along_branch
from ..spatial import Array
from ..structure.module import Module
from ..structure.state import ModuleState

#: A closure row is lost at a posture if its pivot is below this part of the largest: the pivot is rounding.
LOST_PIVOT = 1e-13
#: Smallest squared pivot ratio of the motors' map if only the accelerations of motors are given. The errors
#: of the motion grow with the condition number of this map, and the errors of the efforts with its square.
SINGULAR_ACCELERATION_MAP = 1e-10
#: Below this pivot ratio, the correct digits of the efforts are checked.
NEAR_LOST_PIVOT = 1e-6


def check_closure_rank(module: Module, basis: Basis) -> None:
    """Raise if the closures of a module lose rank at a sample.

    Raises:
        SingularityError: The message names module, sample and condition number.
    """
    lost = np.flatnonzero(basis.pivot < LOST_PIVOT)
    if not len(lost) or not module.mechanism.reduction.rank:
        return
    t = int(lost[0])
    condition = _condition(basis.pivot[t])
    raise _singularity(
        module, "closures", t, condition,
        f"its closures lose rank at sample {t} (constraint singularity; condition number {condition:.1e}, "
        f"limit {1 / LOST_PIVOT:.0e}): more motions than its {module.mobility} freedoms are "
        "instantaneously possible there. "
        'Move the posture away from it, or, for the inverse model, pass on_singular="least-norm"',
    )  # fmt: skip


def check_motor_map(module: Module, pivot: Array) -> None:
    """Raise if the accelerations of the motors do not determine the motion (parallel singularity).

    Args:
        pivot: Smallest pivot of its motors' map over the largest, shape (T,).

    Raises:
        SingularityError: The message names module, sample and condition number.
    """
    lost = np.flatnonzero(pivot**2 < SINGULAR_ACCELERATION_MAP)
    if not len(lost):
        return
    t = int(lost[0])
    condition = _condition(pivot[t] ** 2)
    raise _singularity(
        module, "motors", t, condition,
        f"its motors lose a direction at sample {t} (parallel singularity), and their accelerations alone do "
        f"not determine the motion there (squared condition number {condition:.1e}, limit "
        f"{1 / SINGULAR_ACCELERATION_MAP:.0e}). Give all accelerations and passive=\"given\", or move the "
        "trajectory away",
    )  # fmt: skip


def check_effort_digits(module: Module, basis: Basis, Q: Array, size: Array, weight: float) -> None:
    """Raise if efforts next to a constraint singularity have no correct digit.

    A motion that is not smooth there has accelerations proportional to 1 / pivot and closure wrenches
    proportional to 1 / pivot^2. The efforts are the small difference of these large terms.

    Args:
        Q: Generalised force needed along each motion, shape (T, N), [N m].
        size: Largest term in the sum Q, shape (T,), [N m].
        weight: Largest effort that the robot's weight can cause [N m]; rounding below it is harmless.

    Raises:
        SingularityError: The message names module, sample and condition number.
    """
    rounding = np.finfo(float).eps * size
    kept = np.maximum(np.abs(Q).max(axis=1, initial=0.0), weight) * basis.pivot
    bad = np.flatnonzero((basis.pivot >= LOST_PIVOT) & (basis.pivot < NEAR_LOST_PIVOT) & (rounding > kept))
    if not len(bad) or not module.motors:
        return
    t = int(bad[0])
    condition = _condition(basis.pivot[t])
    raise _singularity(
        module, "closures", t, condition,
        f"its efforts have no correct digit at sample {t}, next to a constraint singularity (condition "
        f"number {condition:.1e}): terms of {size[t]:.1e} N m cancel. The accelerations there are not those "
        "of a smooth motion; take q, v, a from a smooth motion, or move the posture away",
    )  # fmt: skip


def _condition(pivot: float) -> float:
    """Return the condition number for the ratio of the smallest to the largest pivot."""
    return 1 / float(pivot) if pivot > 0 else np.inf


def _singularity(module: Module, what: str, sample: int, condition: float, says: str) -> SingularityError:
    """Build the error for a sample at which a module loses rank."""
    return SingularityError(
        f"module '{module.name}': {says}", module=module.name, what=what, condition=condition, sample=sample
    )


def along_motion(state: ModuleState, basis: Basis) -> Basis:
    """Replace the motions at postures of lost rank by those of the branch that the module is moving on.

    If the module has one freedom and moves, its velocity is exactly the direction of the branch. At rest, or
    where branches are tangent, the branch is unknown: motions and pivots of these samples are not changed.

    Raises:
        SingularityError: A velocity belongs to no branch.
    """
    lost = basis.pivot < LOST_PIVOT
    if not lost.any() or not state.mechanism.reduction.rank:
        return basis
    branch = along_branch(state, replace(basis, pivot=np.where(lost, basis.pivot, 1.0)))
    lost &= branch.pivot >= LOST_PIVOT
    Psi, pivot = branch.Psi.copy(), np.where(lost, branch.pivot, basis.pivot)
    if state.module.mobility == 1:
        x = state.v[lost]
        speed = np.linalg.norm(x / state.mechanism.reduction.col_scale, axis=1)
        Psi[lost, :, 0] = x / speed[:, None]
    return replace(branch, Psi=Psi, pivot=pivot)


def possible_motions(module: Module, K: Array) -> Array:
    """Compute all motions that are instantaneously possible at a posture of lost rank.

    There are more of them than the mobility of the module.

    Args:
        K: Closure rows of the module at this posture, shape (rows, n).

    Returns:
        Shape (n, N + number of lost rows), orthonormal in scaled coordinates.
    """
    r = module.mechanism.reduction
    _, s, Vt = np.linalg.svd(r.scaled(K))
    kept = min(int(np.sum(s > 10 * LOST_PIVOT * s[0])), r.rank - 1)
    return Vt[kept:].T * r.col_scale[:, None]
