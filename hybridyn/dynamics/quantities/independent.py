"""Motions of every module over its independent coordinates, and their drift.

    x_dot = Psi u,    x_ddot = Psi u_dot + drift        the same for the module's part of v: v = E u

Psi follows from the paper's (any basis of the motions that the closures allow) and the rows S of the chosen
joints: S Psi = 1, S drift = 0. With Q an orthonormal basis of the motions in scaled coordinates, Psi = Q P,
and P is the least-norm right inverse of S Q by QR with column pivoting. Motions that u does not determine
have to be idle (a rod's spin) and take least-norm rates, as in `assemble` and `idm`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...assembly.free_motions import are_idle
from ...description.names import counted
from ...errors import AT_SAMPLE, SingularityError
from ...linkage.elimination import back_substitute, pivot_ratio, pivoted_qr
from ...linkage.reduction import Basis
from ...spatial import Array, Index
from ...structure.module import Module, ModuleState
from ..actuation import SINGULAR_MOTOR_MAP
from ..guards import check_closure_rank
from .coordinates import Coordinates


@dataclass(frozen=True, eq=False)
class ModuleMotions:
    """Motions of one module over its independent coordinates.

    Attributes:
        basis: Psi, shape (T, n, m), and the drift of x_ddot, shape (T, n), on the tree after the cuts.
        E: The same map for the module's spanning tree, shape (T, nv, m): a block of dq/du.
        E_drift: Accelerations of the spanning tree at u_dot = 0, shape (T, nv).
    """

    basis: Basis
    E: Array
    E_drift: Array


def independent_motions(
    states: list[ModuleState], q: Array, v: Array | None, u: Coordinates
) -> list[ModuleMotions]:
    """Compute the motions of every module over its independent coordinates.

    Args:
        states: States of its modules.
        q: Positions, shape (T, nq).
        v: Rates that the states have, shape (T, nv); None where no drift is needed.

    Raises:
        SingularityError: Closures lose rank, or the coordinates are not independent at a sample.
    """
    return [module_motions(s, q, v, freedoms, u) for s, freedoms in zip(states, u.freedoms, strict=True)]


def module_motions(
    s: ModuleState, q: Array, v: Array | None, freedoms: Index, u: Coordinates
) -> ModuleMotions:
    """Compute the motions of one module, whose independent coordinates are some freedoms of its tree.

    Args:
        s: State of the module.
        q: Positions of the robot, shape (T, nq).
        v: Rates that the state has, shape (T, nv); None where no drift is needed.
        freedoms: The freedoms of the module's spanning tree, shape (m,).
        u: The independent coordinates, for messages.

    Raises:
        SingularityError: As `independent_motions`.
    """
    module, m = s.module, s.mechanism
    gamma = None if v is None else m.closures.rates(m.tree.sweep(s.q, s.v), s.v)[1]
    basis = m.basis(s.K, gamma)
    check_closure_rank(module, basis)
    unit = m.reduction.col_scale
    Q = np.linalg.qr(basis.Psi / unit[:, None])[0]
    P, Z = _right_inverse(s, spanning_rates(s, Q * unit[:, None]), freedoms, u)
    if Z.shape[2]:
        _refuse_open_motions(s, np.matmul(Q, Z), u)
    Psi = np.matmul(Q, P) * unit[:, None]
    E = spanning_rates(s, Psi)
    if v is None:
        return ModuleMotions(Basis(Psi, np.zeros_like(basis.drift), basis.pivot), E, np.zeros(E.shape[:2]))
    idle, drift = np.matmul(Q, Z), basis.drift / unit
    drift = (drift - np.einsum("tij,tkj,tk->ti", idle, idle, drift, optimize=True)) * unit
    E_drift = s.spanning_accelerations(q, v, drift)
    miss = E_drift[:, freedoms].copy()
    drift = drift - np.einsum("tij,tj->ti", Psi, miss)
    E_drift = E_drift - np.einsum("tij,tj->ti", E, miss)
    E_drift[:, freedoms] = 0.0
    return ModuleMotions(Basis(Psi, drift, basis.pivot), E, E_drift)


def spanning_rates(s: ModuleState, X: Array) -> Array:
    """Compute rates of a module's spanning tree from those of its tree after the cuts.

    Args:
        s: State of the module.
        X: Columns of rates of the tree after the cuts, shape (T, n, k).

    Returns:
        Shape (T, nv, k). The joints of wrists that were cut follow the bodies that they connect.
    """
    m = s.mechanism
    out = np.zeros((len(X), m.spanning.nv, X.shape[2]))
    m.cut.to_spanning(X, out)
    for number in range(len(m.spec.wrists)):
        out[:, m.wrists.columns(number)] = m.wrists.rates_of(s.spanning, s.motion, number, X)
    return out


def _right_inverse(s: ModuleState, rates: Array, freedoms: Index, u: Coordinates) -> tuple[Array, Array]:
    """Compute P with S Q P = 1 of least norm, and Z, an orthonormal basis of what S Q does not see.

    Args:
        s: State of the module.
        rates: Rates of the spanning tree along orthonormal motions Q, shape (T, nv, N).
        freedoms: The chosen freedoms of the spanning tree, shape (m,).

    Returns:
        Shapes (T, N, m) and (T, N, N - m).

    Raises:
        SingularityError: S Q has not full rank at a sample (`SINGULAR_MOTOR_MAP`, scaled coordinates).
    """
    unit = s.mechanism.spanning_col_scale[freedoms]
    S = rates[:, freedoms] / unit[:, None]
    T, m, N = S.shape
    right = np.broadcast_to(np.eye(N), (T, N, N))
    R, order = pivoted_qr(np.concatenate([np.swapaxes(S, 1, 2), right], axis=2), m, m)
    suspect = np.flatnonzero(pivot_ratio(R, m) < SINGULAR_MOTOR_MAP * max(m, 1))
    if len(suspect):
        _refuse_dependent(s.module, S[suspect], suspect, freedoms, u)
    P = np.empty((T, m, N))
    np.put_along_axis(P, order[:, :, None], back_substitute(R[:, :m, :m], R[:, :m, m:]), axis=1)
    return np.swapaxes(P, 1, 2) / unit, np.swapaxes(R[:, m:, m:], 1, 2)


def _refuse_dependent(module: Module, S: Array, samples: Index, freedoms: Index, u: Coordinates) -> None:
    """Refuse samples at which the coordinates are not independent.

    S are their scaled rates along orthonormal motions, shape (samples, m, N).
    """
    U, sizes, _ = np.linalg.svd(S, full_matrices=False)
    lost = np.flatnonzero(sizes[:, -1] <= SINGULAR_MOTOR_MAP * sizes[:, 0])
    if not len(lost):
        return
    t = int(lost[0])
    condition = float(sizes[t, 0] / sizes[t, -1]) if sizes[t, -1] > 0 else np.inf
    slices = module.mechanism.spanning.v_slices
    worst = int(freedoms[int(np.argmax(np.abs(U[t, :, -1])))])
    joint = next(name for name, at in zip(module.joints, slices, strict=True) if at.start <= worst < at.stop)
    raise SingularityError(
        f"module '{module.name}': its {u.words} lose a direction{AT_SAMPLE} ("
        + ("they are not independent" if u.chosen else "parallel singularity")
        + f"; condition number {condition:.1e}, limit {1 / SINGULAR_MOTOR_MAP:.0e}; "
        f"{'joint' if u.chosen else 'motor'} '{joint}' is affected most). Move the trajectory away from it, "
        "or choose other joints with joints=[...]",
        module=module.name,
        what="joints" if u.chosen else "motors",
        condition=condition,
        sample=int(samples[t]),
    )


def _refuse_open_motions(s: ModuleState, motions: Array, u: Coordinates) -> None:
    """Refuse motions that the coordinates do not determine, scaled, shape (T, n, k), and that are not idle.

    Raises:
        SingularityError: Naming the freedom that moves most.
    """
    module = s.module
    open_at = np.flatnonzero(~are_idle(module, motions, s.motion))
    if not len(open_at):
        return
    t = int(open_at[0])
    freedom = module.freedom_names()[int(np.argmax(np.abs(motions[t]).max(axis=1)))]
    raise SingularityError(
        f"module '{module.name}': {module.mobility - motions.shape[2]} {u.words} for "
        f"{counted(module.mobility, 'freedom')} leave the motion of {freedom} open{AT_SAMPLE}. "
        f"{u.mend}, {module.mobility} in this module",
        module=module.name,
        what="independent coordinates",
        condition=np.inf,
        sample=t,
    )
