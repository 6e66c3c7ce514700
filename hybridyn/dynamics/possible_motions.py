"""Motions that the models give a module: those of its closures, of a branch, or with its motors held.

The mobility is a property of the module and does not depend on the posture. At a constraint singularity (a
flat four-bar), more motions than the mobility are instantaneously possible. The velocity determines the
branch that the mechanism follows (`manifold/branch.py`). At rest the motors must balance the forces along all
these motions. Without a force, the acceleration along a motion without inertia is arbitrary; the least norm
is chosen.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..linkage.elimination import least_squares, null_basis
from ..linkage.motion import Motion
from ..linkage.reduction import Basis
from ..spatial import Array
from ..structure.module import Module, ModuleState
from .actuation import motion_size
from .guards import LOST_PIVOT, MOTOR_ACCELERATIONS, check

if TYPE_CHECKING:  # the inverse model does without
    from .inertia_solve import InertiaFactor


def motions_of(state: ModuleState, prescribed: Array | None, passing: bool) -> tuple[Basis, Motion]:
    """Compute the motions of a module for the direct model, and the motion of its tree at x_ddot = 0.

    Args:
        state: State of the module.
        prescribed: Accelerations of the robot, shape (T, nv), whose entries for motors are prescribed,
            or None.
        passing: At postures of lost rank, use the motions of the branch that the velocity belongs to.

    Raises:
        SingularityError: The accelerations of the motors do not determine the motion.
    """
    m = state.mechanism
    unforced = m.tree.sweep(state.q, state.v)
    basis = m.basis(state.K, m.closures.rates(unforced, state.v)[1])
    if passing:
        from ..manifold.branch import along_branch  # few motions pass postures of lost rank

        basis = along_branch(state, basis)
    motors = state.module.motor_columns
    if prescribed is None or not len(motors):
        return basis, unforced
    wanted = m.cut.to_tree(prescribed[:, state.module.v_index])
    unit = m.reduction.col_scale[motors]
    S_Psi = basis.Psi[:, motors] / unit[:, None]
    miss = (basis.drift[:, motors] - wanted[:, motors]) / unit
    size = motion_size(state.module, basis.Psi)
    Z, u_dot, pivot, _ = null_basis(S_Psi, miss, min(S_Psi.shape[1:]), size)
    check(MOTOR_ACCELERATIONS, state.module, np.ones(len(pivot)), pivot**2, lambda t: {"what": "motors"})
    Psi = np.matmul(basis.Psi, Z)
    drift = basis.drift + np.einsum("tij,tj->ti", basis.Psi, u_dot)
    return Basis(Psi, drift, basis.pivot, basis.surplus), unforced


def along_motion(state: ModuleState, basis: Basis) -> Basis:
    """Replace the motions at postures of lost rank by those of the branch that the module is moving on.

    At rest, or where branches are tangent, the branch is unknown: motions and pivots of these samples are not
    changed.

    Raises:
        SingularityError: A velocity belongs to no branch.
    """
    lost = basis.pivot < LOST_PIVOT
    if not lost.any() or not state.mechanism.reduction.rank:
        return basis
    from ..manifold.branch import along_branch  # few motions pass postures of lost rank

    branch = along_branch(state, basis._replace(pivot=np.where(lost, basis.pivot, 1.0)))
    lost &= branch.pivot >= LOST_PIVOT
    return branch._replace(pivot=np.where(lost, branch.pivot, basis.pivot))


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


def least_norm(module: Module, basis: Basis, inertia: InertiaFactor, u_dot: Array) -> None:
    """Choose, in place, the least-norm accelerations along motions without inertia.

    Args:
        inertia: Principal motions of its inertia.
        u_dot: Independent accelerations, shape (T, N); changed at samples with massless motions.
    """
    unit = module.mechanism.reduction.col_scale
    for t in np.flatnonzero(inertia.massless.any(axis=1)):
        Psi = basis.Psi[t] / unit[:, None]
        null = inertia.motions[t][:, inertia.massless[t]]
        x = Psi @ u_dot[t] + basis.drift[t] / unit
        u_dot[t] -= null @ least_squares((Psi @ null)[None], x[None])[0]
