"""What to do where a module's closures lose rank: a constraint singularity, such as a four-bar lying flat.

Mobility belongs to the module and never changes with the posture; at such a posture more motions than that
are possible for an instant. The velocity says which of them the mechanism goes on with (`branch.py`); at rest
motors have to hold them all.
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

#: A smallest pivot below this part of the largest is rounding: the row is lost at that posture.
LOST_PIVOT = 1e-13
#: Accelerations of the motors alone determine the motion up to the condition number of the motors' map, and
#: the motion their efforts up to the same again: the limit on both together, as a reciprocal.
SINGULAR_ACCELERATION_MAP = 1e-10
#: From this near on, the digits are counted that a small pivot leaves.
NEAR_LOST_PIVOT = 1e-6


def refuse_lost_rank(module: Module, basis: Basis) -> None:
    """Raise where the closures of a module lose rank.

    Raises:
        SingularityError: Naming module, sample and condition number.
    """
    lost = np.flatnonzero(basis.pivot < LOST_PIVOT)
    if not len(lost) or not module.mechanism.reduction.rank:
        return
    t = int(lost[0])
    condition = _condition(basis.pivot[t])
    raise _refusal(
        module, "closures", t, condition,
        f"its closures lose rank at sample {t} (constraint singularity; condition number {condition:.1e}, "
        f"limit {1 / LOST_PIVOT:.0e}): more than its {module.mobility} freedoms are possible there for an "
        "instant. "
        'Move the posture away from it, or, for the inverse model, pass on_singular="least-norm"',
    )  # fmt: skip


def refuse_undetermined_motion(module: Module, pivot: Array) -> None:
    """Raise where accelerations of the motors do not determine the motion (parallel singularity).

    Args:
        module: The module.
        pivot: Smallest pivot of its motors' map over the largest, shape (T,).

    Raises:
        SingularityError: Naming module, sample and condition number.
    """
    lost = np.flatnonzero(pivot**2 < SINGULAR_ACCELERATION_MAP)
    if not len(lost):
        return
    t = int(lost[0])
    condition = _condition(pivot[t] ** 2)
    raise _refusal(
        module, "motors", t, condition,
        f"its motors lose a direction at sample {t} (parallel singularity), and their accelerations alone do "
        f"not determine the motion there (condition number {condition:.1e} together with the efforts, limit "
        f"{1 / SINGULAR_ACCELERATION_MAP:.0e}). Give all accelerations, passive=\"given\", or move the "
        "trajectory away",
    )  # fmt: skip


def refuse_lost_digits(module: Module, basis: Basis, Q: Array, size: Array, weight: float) -> None:
    """Raise where efforts next to a constraint singularity have no correct digit.

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
    bad = np.flatnonzero((basis.pivot >= LOST_PIVOT) & (basis.pivot < NEAR_LOST_PIVOT) & (rounding > kept))
    if not len(bad) or not module.motors:
        return
    t = int(bad[0])
    condition = _condition(basis.pivot[t])
    raise _refusal(
        module, "closures", t, condition,
        f"no digit of its efforts is left at sample {t}, next to a constraint singularity (condition number "
        f"{condition:.1e}): terms of {size[t]:.1e} N m cancel. Such accelerations are not those of a smooth "
        "motion there; take q, v, a of one that is, or move the posture away",
    )  # fmt: skip


def _condition(pivot: float) -> float:
    """Return the condition number that a smallest pivot, as a part of the largest, stands for."""
    return 1 / float(pivot) if pivot > 0 else np.inf


def _refusal(module: Module, what: str, sample: int, condition: float, says: str) -> SingularityError:
    """Return the error for a sample at which a module lost rank."""
    return SingularityError(
        f"module '{module.name}': {says}", module=module.name, what=what, condition=condition, sample=sample
    )


def along_motion(state: ModuleState, basis: Basis) -> Basis:
    """Return the motions at postures of lost rank: those of the branch that the module is moving on.

    A single freedom that moves is that branch itself, to the last digit. At rest, and where branches only
    touch, nothing tells the branch: those samples are left as they are, pivots included.

    Args:
        state: The module's state.
        basis: Its motions as the elimination gave them.

    Raises:
        SingularityError: A velocity is on no branch.
    """
    lost = basis.pivot < LOST_PIVOT
    if not lost.any() or not state.mechanism.reduction.rank:
        return basis
    told = along_branch(state, replace(basis, pivot=np.where(lost, basis.pivot, 1.0)))
    lost &= told.pivot >= LOST_PIVOT
    Psi, pivot = told.Psi.copy(), np.where(lost, told.pivot, basis.pivot)
    if state.module.mobility == 1:
        x = state.v[lost]
        speed = np.linalg.norm(x / state.mechanism.reduction.col_scale, axis=1)
        Psi[lost, :, 0] = x / speed[:, None]
    return replace(told, Psi=Psi, pivot=pivot)


def possible_motions(module: Module, K: Array) -> Array:
    """Return all motions that are possible for an instant at a posture of lost rank, more than the mobility.

    Args:
        module: The module.
        K: Its closure rows there, shape (rows, n).

    Returns:
        Shape (n, N + number of lost rows), orthonormal in scaled coordinates.
    """
    r = module.mechanism.reduction
    _, s, Vt = np.linalg.svd(r.scaled(K))
    kept = min(int(np.sum(s > 10 * LOST_PIVOT * s[0])), r.rank - 1)
    out: Array = Vt[kept:].T * r.col_scale[:, None]
    return out
