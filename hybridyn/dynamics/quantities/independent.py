"""The independent coordinates u of a robot, and the motions of every module over them.

The coordinates are the motors, or joints that the caller chooses. A floating base adds its twist, the first
six of v, in front. The base of a "moving" robot is prescribed and not among them.

    x_dot = Psi u,    x_ddot = Psi u_dot + drift        the same for the module's part of v: v = E u

Psi follows from the paper's (any basis of the motions that the closures allow) and the rows S of the chosen
joints: S Psi = 1, S drift = 0. With Q an orthonormal basis of the motions in scaled coordinates, Psi = Q P,
and P is the least-norm right inverse of S Q. Motions that u does not determine have to be idle (a rod's spin)
and take least-norm rates, as in `assemble` and `idm`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from ...assembly.free_motions import are_idle
from ...assembly.posture import check_joints
from ...description.names import counted
from ...errors import SingularityError
from ...linkage.joints import ROOT_JOINT
from ...linkage.reduction import Basis
from ...spatial import Array, Index
from ...structure.module import Module, ModuleState
from ...structure.robot import HybridRobot
from ..guards import LOST_MOTORS, OPEN_MOTIONS, check, check_closure_rank


@dataclass(frozen=True, eq=False)
class IndependentCoordinates:
    """Independent coordinates of a robot.

    Attributes:
        joints: The joints, in the order of u; a floating base's root joint is the first.
        columns: Entries of v that u consists of, shape (N,).
        own: For each module its entries of u, shape (m,).
        freedoms: For each module the freedoms of its spanning tree that they are, shape (m,).
        chosen: Whether the caller chose the joints; else they are the motors.
        mend: What messages advise where the joints do not fit.
    """

    joints: tuple[str, ...]
    columns: Index
    own: tuple[Index, ...]
    freedoms: tuple[Index, ...]
    chosen: bool
    mend: str = "Name the independent joints with joints=[...]"

    @property
    def size(self) -> int:
        """Number of independent coordinates."""
        return len(self.columns)

    @property
    def words(self) -> str:
        """What messages call the joints."""
        return "chosen joints" if self.chosen else "motors"

    def fit(self, robot: HybridRobot, idle: str = "") -> None:
        """Refuse more coordinates than a module has freedoms.

        Args:
            idle: What is not defined where fewer leave idle motions open, whose least-norm rates integrate
                to no position; they are then refused, too.

        Raises:
            SingularityError: Naming the module.
        """
        for module, own in zip(robot.modules, self.own, strict=True):
            spare = len(own) - module.mobility
            if spare > 0 or (spare < 0 and idle):
                fewer = f"leave idle motions open, and {idle} is not defined"
                why = "cannot be independent" if spare > 0 else fewer
                raise SingularityError(
                    f"module '{module.name}': {len(own)} {self.words} for "
                    f"{counted(module.mobility, 'freedom')} {why}. "
                    f"{self.mend}, {module.mobility} in this module",
                    module=module.name,
                    what="independent coordinates",
                    condition=np.inf,
                )


def independent_coordinates(robot: HybridRobot, joints: Sequence[str] | None) -> IndependentCoordinates:
    """Return the independent coordinates of a robot.

    Args:
        joints: Names of joints with one freedom each, as many in each module as it has freedoms; the motors
            where left out.

    Raises:
        TrajectoryError: A joint is unknown, named twice, or has several freedoms.
        SingularityError: A module has more of these joints than freedoms.
    """
    base = (ROOT_JOINT,) if robot.base == "floating" else ()
    names = tuple(name for name in (robot.motors if joints is None else joints) if name not in base)
    check_joints(robot, names)
    out = located(robot, (*base, *names), chosen=joints is not None)
    out.fit(robot)
    return out


def located(robot: HybridRobot, names: tuple[str, ...], *, chosen: bool) -> IndependentCoordinates:
    """Return where joints lie in v and in the modules.

    Args:
        names: Known joints.
        chosen: Whether the caller chose them.
    """
    slices = [robot.v_slices[robot.joint_index[name]] for name in names]
    columns = np.array([c for at in slices for c in range(at.start, at.stop)], dtype=int)
    entry = {int(column): i for i, column in enumerate(columns)}
    own, freedoms = [], []
    for module in robot.modules:
        held = sorted((entry[int(c)], i) for i, c in enumerate(module.v_index) if int(c) in entry)
        own.append(np.array([i for i, _ in held], dtype=int))
        freedoms.append(np.array([i for _, i in held], dtype=int))
    return IndependentCoordinates(names, columns, tuple(own), tuple(freedoms), chosen)


class Motions(NamedTuple):
    """Motions of a robot over its independent coordinates.

    Attributes:
        bases: Of each module Psi, shape (T, n, m), and the drift of x_ddot, shape (T, n), on the tree after
            the cuts.
        E: The same map for the spanning tree, dq/du, shape (T, nv, N); blocks of modules.
        drift: Accelerations of the spanning tree at u_dot = 0, shape (T, nv).
    """

    bases: list[Basis]
    E: Array
    drift: Array


def independent_motions(
    robot: HybridRobot, states: list[ModuleState], q: Array, v: Array | None, u: IndependentCoordinates,
    *, others_stay: bool = False,
) -> Motions:  # fmt: skip
    """Compute the motions of a robot over its independent coordinates.

    Args:
        states: States of its modules.
        q: Positions, shape (T, nq).
        v: Rates that the states have, shape (T, nv); None where no drift is needed.
        u: The coordinates.
        others_stay: Whether modules without any of them are left out, also if they could move.

    Raises:
        SingularityError: Closures lose rank, or the coordinates are not independent at a sample.
    """
    out = Motions([], np.zeros((len(q), robot.nv, u.size)), np.zeros((len(q), robot.nv)))
    for s, own, freedoms in zip(states, u.own, u.freedoms, strict=True):
        if others_stay and not len(own):
            continue
        basis, E, drift = module_motions(s, q, v, freedoms, u)
        out.bases.append(basis)
        out.E[:, s.module.v_index[:, None], own], out.drift[:, s.module.v_index] = E, drift
    return out


def module_motions(
    s: ModuleState, q: Array, v: Array | None, freedoms: Index, u: IndependentCoordinates
) -> tuple[Basis, Array, Array]:
    """Compute the motions of one module, whose independent coordinates are some freedoms of its tree.

    Args:
        s: State of the module.
        q: Positions of the robot, shape (T, nq).
        v: Rates that the state has, shape (T, nv); None where no drift is needed.
        freedoms: The freedoms of the module's spanning tree, shape (m,).
        u: The independent coordinates, for messages.

    Returns:
        The basis on the tree after the cuts; E, shape (T, nv, m), and the drift, shape (T, nv), on the
        spanning tree.

    Raises:
        SingularityError: As `independent_motions`.
    """
    module, m = s.module, s.mechanism
    basis = m.basis(s.K, None if v is None else m.closures.rates(m.tree.sweep(s.q, s.v), s.v)[1])
    check_closure_rank(module, basis)
    unit = m.reduction.col_scale
    Q = np.linalg.qr(basis.Psi / unit[:, None])[0]
    P, idle = _right_inverse(s, Q, freedoms, u)  # Eq. (3): J_r of motors as coordinates
    Psi = np.matmul(Q, P) * unit[:, None]  # Eqs. (4), (15): a J_r, and that of the legs' joints
    E = _spanning_rates(s, Psi)
    drift, E_drift = np.zeros_like(basis.drift), np.zeros(E.shape[:2])
    if v is not None:
        drift = basis.drift / unit
        drift = (drift - np.einsum("tij,tkj,tk->ti", idle, idle, drift, optimize=True)) * unit
        E_drift = s.spanning_accelerations(v, drift)
        miss = E_drift[:, freedoms].copy()
        drift = drift - np.einsum("tij,tj->ti", Psi, miss)  # Eq. (7)
        E_drift = E_drift - np.einsum("tij,tj->ti", E, miss)
        E_drift[:, freedoms] = 0.0
    return Basis(Psi, drift, basis.pivot, basis.surplus), E, E_drift


def _spanning_rates(s: ModuleState, X: Array) -> Array:
    """Compute rates of a module's spanning tree from those of its tree after the cuts.

    Args:
        s: State of the module.
        X: Columns of rates of the tree after the cuts, shape (T, n, k).

    Returns:
        Shape (T, nv, k). The joints of wrists that were cut follow the bodies that they connect.
    """
    m = s.mechanism
    return m.cut.to_spanning(m.wrists.rates(s.whole, X) if m.spec.wrists else X)


def _right_inverse(
    s: ModuleState, Q: Array, freedoms: Index, u: IndependentCoordinates
) -> tuple[Array, Array]:
    """Compute P with S Q P = 1 of least norm, and the motions that S does not see, by an SVD of S Q.

    S is scaled and Q orthonormal, so singular values are compared with 1: where the closures lock all
    chosen freedoms, the largest is rounding, too.

    Args:
        s: State of the module.
        Q: Its motions, orthonormal in scaled coordinates, shape (T, n, N).
        freedoms: The chosen freedoms of the spanning tree, shape (m,).
        u: The independent coordinates, for messages.

    Returns:
        P, shape (T, N, m), and these motions, orthonormal, shape (T, n, N - m).

    Raises:
        SingularityError: S Q has not full rank at a sample (`SINGULAR_MOTOR_MAP`, scaled coordinates), or
            motions that S does not see are not idle.
    """
    module, m = s.module, s.mechanism
    unit, count = m.spanning_col_scale[freedoms], len(freedoms)
    rates = _spanning_rates(s, Q * m.reduction.col_scale[:, None])
    U, size, Vt = np.linalg.svd(rates[:, freedoms] / unit[:, None])
    if count:
        check(LOST_MOTORS, module, np.ones(len(size)), size[:, -1], partial(_lost, module, freedoms, U, u))
    idle = np.matmul(Q, np.swapaxes(Vt[:, count:], 1, 2))
    if idle.shape[2]:
        words = partial(_left_open, module, count, idle, u)
        check(OPEN_MOTIONS, module, np.where(are_idle(module, idle, s.motion), 0.0, 1.0), 0.0, words)
    P = np.matmul(np.swapaxes(Vt[:, :count], 1, 2) / size[:, None], np.swapaxes(U, 1, 2)) / unit
    return P, idle


def _lost(module: Module, freedoms: Index, U: Array, u: IndependentCoordinates, t: int) -> dict[str, Any]:
    """Return what the guard says of lost coordinates at sample t: it names the joint that loses most."""
    worst = int(freedoms[int(np.argmax(np.abs(U[t, :, -1])))])
    slices = module.mechanism.spanning.v_slices
    return {
        "joints": u.words, "what": u.words.split()[-1], "kind": "joint" if u.chosen else "motor",
        "reason": "they are not independent" if u.chosen else "parallel singularity",
        "worst": module.joints[next(i for i, at in enumerate(slices) if worst < at.stop)],
        "advice": "choose other joints with joints=[...]",
    }  # fmt: skip


def _left_open(module: Module, count: int, idle: Array, u: IndependentCoordinates, t: int) -> dict[str, Any]:
    """Return what the guard says of motions left open at sample t: it names the freedom that moves most."""
    return {
        "what": "independent coordinates", "joints": f"{count} {u.words}",
        "freedoms": counted(module.mobility, "freedom"), "condition": np.inf,
        "freedom": module.freedom_names()[int(np.argmax(np.abs(idle[t]).max(axis=1)))],
        "advice": f"{u.mend}, {module.mobility} in this module",
    }  # fmt: skip
