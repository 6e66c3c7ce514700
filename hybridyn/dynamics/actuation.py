"""Compute the efforts of a module's motors from the generalised force that it needs: B tau = Q, Eq. (33).

Q and the columns of B are work per scaled coordinate [N m], so that forces and torques are comparable. The
efforts of redundant motors are distributed by weights, and efforts of different units are never compared.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..assembly.free_motions import free_motions, idle_motions
from ..description.names import listed
from ..errors import AT_SAMPLE, ActuationError, SingularityError
from ..linkage.elimination import back_substitute, pivot_ratio, pivoted_qr
from ..linkage.tree import Motion
from ..spatial import Array, Index
from ..structure.module import Module
from ..structure.robot import HybridRobot

#: A motor map with a reciprocal condition number below this is at a parallel (type 2) singularity.
SINGULAR_MOTOR_MAP = 1e-10
#: Largest generalised force that may remain without a motor, as a part of the largest term.
UNDRIVEN = 1e-6


class Sharing(NamedTuple):
    """How the load is distributed among redundant motors.

    Attributes:
        weights: One weight per motor; the sum of weight x effort^2 is minimal. None: by effort limits.
        on_singular: "raise", or "least-norm" to use the least efforts at a singular posture.
        passive_hint: Advice in the error message if a passive motion would need an effort.
    """

    weights: Array | None
    on_singular: str
    passive_hint: str = ""


class Need(NamedTuple):
    """Generalised force that a module's motors must produce.

    Attributes:
        Q: Generalised force needed along each motion, shape (T, N), [N m].
        size: Largest term in the sum Q, shape (T,), [N m].
        rounding: Rounding that may remain in Q if all terms cancel, shape (T,), [N m].
        motion: Motion of the module's tree.
    """

    Q: Array
    size: Array
    rounding: Array
    motion: Motion


def motor_units(module: Module) -> Array:
    """Return the factor that converts each motor's effort to work per scaled coordinate, shape (motors,)."""
    return module.mechanism.reduction.col_scale[module.motor_columns]


def motor_efforts(robot: HybridRobot, module: Module, Psi: Array, need: Need, sharing: Sharing) -> Array:
    """Compute the efforts of a module's motors.

    Args:
        Psi: Motions of the module, shape (T, n, N).
        need: Generalised force that the motors must produce.
        sharing: How the load is distributed among redundant motors.

    Returns:
        Efforts, shape (T, motors), [N or N m]; zero for a motor that the closures lock.

    Raises:
        ActuationError: Motors are missing, or redundant motors of different units have no weights.
        SingularityError: The motors lose a direction and `on_singular` is "raise".
    """
    Q = need.Q
    T, N = Q.shape
    moving = module.moving_motors
    motors = len(moving)
    unit = motor_units(module)[moving]
    B = np.swapaxes(Psi[:, module.motor_columns[moving]], 1, 2) / unit
    if motors == 0:
        tau = np.zeros((T, 0))
    elif motors == N:
        tau = _square(module, Psi, B, Q, sharing)
    else:
        share = np.ones(motors) if motors < N else load_share(robot, module, sharing, moving) * unit
        tau = _least_norm(module, Psi, B, Q, share, sharing)
    missing = Q - np.einsum("tij,tj->ti", B, tau)
    _check_driven(module, Psi, missing, need, sharing)
    out = np.zeros((T, len(module.motors)))
    out[:, moving] = tau / unit
    return out


def _square(module: Module, Psi: Array, B: Array, Q: Array, sharing: Sharing) -> Array:
    """Solve B tau = Q by QR with column pivoting; at singular samples use `_least_norm`, which may raise."""
    n = B.shape[1]
    R, order = pivoted_qr(np.concatenate([B, Q[..., None]], axis=-1), n, n)
    tau = np.empty_like(Q)
    np.put_along_axis(tau, order, back_substitute(R[:, :n, :n], R[:, :n, n:])[..., 0], axis=1)
    suspect = np.flatnonzero(pivot_ratio(R, n) < SINGULAR_MOTOR_MAP * n)
    if len(suspect):
        share = np.ones(n)
        tau[suspect] = _least_norm(module, Psi[suspect], B[suspect], Q[suspect], share, sharing, suspect)
    return tau


def _least_norm(
    module: Module,
    Psi: Array,
    B: Array,
    Q: Array,
    share: Array,
    sharing: Sharing,
    samples: Index | None = None,
) -> Array:
    """Solve B tau = Q for the tau with the least norm of tau / share, by an SVD.

    Motions are made orthonormal first, so that the residual does not depend on the coordinates u.
    """
    R = np.linalg.qr(Psi / module.mechanism.reduction.col_scale[:, None], mode="r")
    along = np.linalg.solve(np.swapaxes(R, 1, 2), np.concatenate([B, Q[..., None]], axis=-1))
    B, Q = along[..., :-1], along[..., -1]
    U, s, Vt = np.linalg.svd(B * share, full_matrices=False)
    keep = s > SINGULAR_MOTOR_MAP * s[:, :1]
    lost = np.flatnonzero(~keep.all(axis=1))
    if len(lost) and sharing.on_singular == "raise":
        t = int(lost[0])
        condition = float(s[t, 0] / s[t, -1]) if s[t, -1] > 0 else np.inf
        sample = t if samples is None else int(samples[t])
        worst = module.motors[module.moving_motors[int(np.argmax(np.abs(Vt[t, -1])))]]
        raise SingularityError(
            f"module '{module.name}': its motors lose a direction{AT_SAMPLE} (parallel singularity; "
            f"condition number {condition:.1e}, limit {1 / SINGULAR_MOTOR_MAP:.0e}; motor '{worst}' is "
            'affected most). Move the trajectory away from it, or pass on_singular="least-norm"',
            module=module.name,
            what="motors",
            condition=condition,
            sample=sample,
        )
    y = np.where(keep, np.einsum("tji,tj->ti", U, Q) / np.where(keep, s, 1.0), 0.0)
    out: Array = np.einsum("tji,tj->ti", Vt, y) * share
    return out


def load_share(robot: HybridRobot, module: Module, sharing: Sharing, among: Index) -> Array:
    """Return the share of each motor in the load: its effort limit, or 1 / sqrt(weight), [N or N m].

    Args:
        sharing: How the load is distributed among redundant motors.
        among: Numbers, in the module, of the motors that share the load.

    Raises:
        ActuationError: Motors have different units, and there are neither weights nor effort limits.
    """
    if sharing.weights is not None:
        return 1.0 / np.sqrt(sharing.weights[module.motor_index[among]])
    record = {j.joint.name: j.joint for j in robot.bodies.joints}
    motors = [module.motors[i] for i in among]
    limits = np.array([record[m].effort_limit for m in motors])
    if np.isfinite(limits).all():
        return limits
    if len({record[m].kind == "prismatic" for m in motors}) > 1:
        raise ActuationError(
            f"module '{module.name}': {len(motors)} motors, some in N and some in N m, share "
            f"{module.mobility} freedoms. Give weights, or an effort limit for each motor, so that their "
            "efforts compare",
            module=module.name,
        )
    return np.ones(len(limits))


def _check_driven(module: Module, Psi: Array, missing: Array, need: Need, sharing: Sharing) -> None:
    """Raise if a motion that no motor drives needs an effort; idle motions are excepted.

    A least-norm answer leaves out what motors lose at a singular posture, but not what they never drive.
    """
    lack = np.abs(missing).max(axis=1, initial=0.0)
    bad = np.flatnonzero(lack > np.maximum(UNDRIVEN * need.size, need.rounding))
    if not len(bad) or (sharing.on_singular != "raise" and not free_motions(module).uncontrolled):
        return
    missing, size = missing.copy(), np.maximum(need.size, need.rounding / UNDRIVEN)
    missing[bad] -= _idle_part(module, Psi[bad], missing[bad], need.motion.take(bad))
    lack = np.abs(missing).max(axis=1, initial=0.0)
    t = int(bad[np.argmax(lack[bad] / size[bad])])
    if lack[t] <= UNDRIVEN * size[t]:
        return
    m = module.mechanism
    at = int(np.argmax(np.abs(Psi[t] @ missing[t] / m.reduction.col_scale)))
    joint, linear = module.freedom_names()[at], m.tree.S_linear[at].any()
    force, unit = float(lack[t] / m.reduction.col_scale[at]), "N" if linear else "N m"
    locked = [name for i, name in enumerate(module.motors) if i not in module.moving_motors]
    but = f" (the closures lock {listed(locked)})" if locked else ""
    raise ActuationError(
        f"module '{module.name}': {len(module.motors)} motors{but} for {module.mobility} freedoms; no motor "
        f"can produce the {force:.3g} {unit} that the motion of {joint} needs{AT_SAMPLE} (largest term "
        f"{need.size[t] / m.reduction.col_scale[at]:.3g} {unit}). "
        + (sharing.passive_hint or "Add a motor there"),
        module=module.name,
        direction=joint,
        size=force,
        sample=t,
    )


def _idle_part(module: Module, Psi: Array, missing: Array, motion: Motion) -> Array:
    """Compute the part of missing forces that does work on idle motions only (a rod's spin), shape (T, N).

    Motions are made orthonormal first, as in `_least_norm`.
    """
    along = Psi / module.mechanism.reduction.col_scale[:, None]
    orthonormal, R = np.linalg.qr(along)
    out = np.zeros_like(missing)
    for t, idle in enumerate(idle_motions(module, orthonormal, motion)):
        force = np.linalg.solve(R[t].T, missing[t])
        out[t] = R[t].T @ (idle @ (idle.T @ force))
    return out
