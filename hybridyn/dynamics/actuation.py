"""Compute the efforts of a module's motors from the generalised force that it needs: B tau = Q, Eq. (33).

Q and the columns of B are work per scaled coordinate [N m], so that forces and torques are comparable. The
efforts of redundant motors are distributed by weights, and efforts of different units are never compared.
"""

from typing import Any, NamedTuple

import numpy as np

from ..assembly.free_motions import free_motions, idle_motions
from ..description.names import counted, listed
from ..errors import ActuationError
from ..linkage.elimination import null_basis
from ..linkage.motion import Motion
from ..spatial import Array, Index
from ..structure.module import Module
from ..structure.robot import HybridRobot
from .guards import LOST_MOTORS, NO_MOTOR, SINGULAR_MOTOR_MAP, UNDRIVEN, check


class Sharing(NamedTuple):
    """How the load is distributed among redundant motors.

    Attributes:
        weights: One weight per motor; the sum of weight x effort^2 is minimal. None: by effort limits.
        on_singular: "raise", or "least-norm" to use the least efforts at a singular posture.
        passive_hint: Advice in the error message if a passive motion would need an effort.
        balanced: Whether that is an error. Under a part of the loads it is none.
    """

    weights: Array | None
    on_singular: str
    passive_hint: str
    balanced: bool = True


class Need(NamedTuple):
    """Generalised force that a module's motors must produce.

    Attributes:
        Psi: Motions of the module, shape (T, n, N).
        Q: Generalised force needed along each motion, shape (T, N), [N m].
        size: Largest term in the sum Q, shape (T,), [N m].
        rounding: Rounding that may remain in Q if all terms cancel, shape (T,), [N m].
        motion: Motion of the module's tree.
    """

    Psi: Array
    Q: Array
    size: Array
    rounding: Array
    motion: Motion


def motor_efforts(robot: HybridRobot, module: Module, need: Need, sharing: Sharing) -> Array:
    """Compute the efforts of a module's motors.

    Args:
        need: Generalised force that the motors must produce.
        sharing: How the load is distributed among redundant motors.

    Returns:
        Efforts, shape (T, motors), [N or N m]; zero for a motor that the closures lock.

    Raises:
        ActuationError: Motors are missing, or redundant motors of different units have no weights.
        SingularityError: The motors lose a direction and `on_singular` is "raise".
    """
    T, N = need.Q.shape
    moving, columns = module.moving_motors, module.motor_columns[module.moving_motors]
    unit = module.mechanism.reduction.col_scale[columns]
    B = np.swapaxes(need.Psi[:, columns], 1, 2) / unit
    tau, share, hard = np.zeros((T, len(moving))), np.ones(len(moving)), np.arange(T)
    if len(moving) > module.driven:
        share = load_share(robot, module, sharing.weights) * unit
    elif len(moving) == N:
        _, tau, pivot, _ = null_basis(B, -need.Q, N, motion_size(module, need.Psi))
        hard = np.flatnonzero(pivot < SINGULAR_MOTOR_MAP * N)
    if len(moving) and len(hard):
        tau[hard] = least_norm(module, B, need, share, sharing, hard)
    if sharing.balanced:
        _check_driven(module, need.Q - np.einsum("tij,tj->ti", B, tau), need, sharing)
    out = np.zeros((T, len(module.motors)))
    out[:, moving] = tau / unit
    return out


def motion_size(module: Module, Psi: Array) -> Array:
    """Return the size with which the motors' share in a module's motions is compared, shape (T,).

    It is the largest scaled rate of any joint: where motors lose all motions, their own largest is rounding.
    """
    out: Array = np.abs(Psi / module.mechanism.reduction.col_scale[:, None]).max(axis=(1, 2), initial=0.0)
    return out


def least_norm(module: Module, B: Array, need: Need, share: Array, sharing: Sharing, at: Index) -> Array:
    """Solve B tau = Q, at some samples, for the tau with the least norm of tau / share, by an SVD.

    Motions are made orthonormal first, so that the residual does not depend on the coordinates u, and that
    singular values compare with the largest share: those of motors that lose all motions are all rounding.
    """
    R = np.linalg.qr(need.Psi[at] / module.mechanism.reduction.col_scale[:, None], mode="r")
    right = np.concatenate([B[at], need.Q[at, :, None]], axis=-1)
    along = np.linalg.solve(np.swapaxes(R, 1, 2), right)
    U, s, Vt = np.linalg.svd(along[..., :-1] * share, full_matrices=False)
    if sharing.on_singular == "raise":

        def words(t: int) -> dict[str, Any]:
            """Name the motor that loses most."""
            worst = module.motors[module.moving_motors[int(np.argmax(np.abs(Vt[t, -1])))]]
            return {
                "what": "motors", "joints": "motors", "reason": "parallel singularity", "kind": "motor",
                "worst": worst, "advice": 'pass on_singular="least-norm"',
            }  # fmt: skip

        least = s[:, max(module.driven, 1) - 1]
        check(LOST_MOTORS, module, np.full(len(s), share.max()), least, words, at)
    keep = s > SINGULAR_MOTOR_MAP * share.max()
    y = np.where(keep, np.einsum("tji,tj->ti", U, along[..., -1]) / np.where(keep, s, 1.0), 0.0)
    out: Array = np.einsum("tji,tj->ti", Vt, y) * share
    return out


def load_share(robot: HybridRobot, module: Module, weights: Array | None) -> Array:
    """Return the share of each moving motor in the load: its effort limit, or 1 / sqrt(weight), [N or N m].

    Args:
        weights: As in `Sharing`.

    Raises:
        ActuationError: Motors have different units, and there are neither weights nor effort limits.
    """
    if weights is not None:
        return 1.0 / np.sqrt(weights[module.motor_index[module.moving_motors]])
    motors = [robot.records[module.motors[i]] for i in module.moving_motors]
    limits = np.array([motor.effort_limit for motor in motors])
    if np.isfinite(limits).all():
        return limits
    if len({motor.kind.slides for motor in motors}) > 1:
        raise ActuationError(
            f"module '{module.name}': {len(motors)} motors, some in N and some in N m, share "
            f"{counted(module.driven, 'freedom')}. Give weights, or an effort limit for each motor, so that "
            "their efforts compare",
            module=module.name,
        )
    return np.ones(len(limits))


def _check_driven(module: Module, missing: Array, need: Need, sharing: Sharing) -> None:
    """Raise if a motion that no motor drives needs an effort; idle motions are excepted.

    A least-norm answer leaves out what motors lose at a singular posture, but not what they never drive.

    Args:
        missing: Generalised force that the motors do not produce, shape (T, N), [N m].
    """
    least = np.maximum(need.size, need.rounding / UNDRIVEN)
    bad = np.flatnonzero(np.abs(missing).max(axis=1, initial=0.0) > UNDRIVEN * least)
    if not len(bad) or (sharing.on_singular != "raise" and not free_motions(module).uncontrolled):
        return
    missing = missing[bad] - _idle_part(module, need.Psi[bad], missing[bad], need.motion.take(bad))
    lack, m = np.abs(missing).max(axis=1, initial=0.0), module.mechanism

    def words(t: int) -> dict[str, Any]:
        """Name the freedom that moves most, and the force on it."""
        at = int(np.argmax(np.abs(need.Psi[bad[t]] @ missing[t] / m.reduction.col_scale)))
        unit = m.reduction.col_scale[at]
        locked = [name for i, name in enumerate(module.motors) if i not in module.moving_motors]
        but = f" (the closures lock {listed(locked)})" if locked else ""
        return {
            "motors": f"{counted(len(module.motors), 'motor')}{but}",
            "freedoms": counted(module.mobility, "freedom"), "direction": module.freedom_names()[at],
            "unit": "N" if m.tree.linear[at] else "N m", "size": float(lack[t] / unit),
            "term": need.size[bad[t]] / unit, "advice": sharing.passive_hint,
        }  # fmt: skip

    check(NO_MOTOR, module, lack, least[bad], words, bad)


def _idle_part(module: Module, Psi: Array, missing: Array, motion: Motion) -> Array:
    """Compute the part of missing forces that does work on idle motions only (a rod's spin), shape (T, N).

    Motions are made orthonormal first, as in `least_norm`.
    """
    orthonormal, R = np.linalg.qr(Psi / module.mechanism.reduction.col_scale[:, None])
    out = np.zeros_like(missing)
    for t, idle in enumerate(idle_motions(module, orthonormal, motion)):
        force = np.linalg.solve(R[t].T, missing[t])
        out[t] = R[t].T @ (idle @ (idle.T @ force))
    return out
