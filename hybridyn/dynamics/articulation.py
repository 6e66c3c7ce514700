"""Recursions of the direct model: articulated inertias (backward) and accelerations (forward).

Articulated inertias are computed by congruence transformations, a form of Eqs. (45), (47) that keeps them
positive semidefinite. The paper's S2, S3, K and alpha are not needed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..effects.choice import Effects
from ..linkage.elimination import null_basis
from ..linkage.reduction import Basis
from ..linkage.tree import Motion
from ..manifold.branch import along_branch
from ..spatial import Array, motion_matrix
from ..structure.robot import HybridRobot
from ..structure.state import ModuleState
from .balance import LegTerms, balance_of_legs, congruence, largest, leg_terms, size_of_solution
from .inertia_rounding import cancelled_inertia, force_of_slips, inertia_of_slips, rounding_of, slips_of
from .inertia_solve import EPS, InertiaFactor, factor_inertia
from .loads import Loads, ModuleLoad
from .lost_digits import warn_of_lost_accelerations
from .lost_rank import check_closure_rank, check_motor_map
from .massless import FORCED, check_massless_forces, choose_least_norm


@dataclass(frozen=True)
class Motions:
    """Motions of one module.

    Attributes:
        basis: Basis of the motions and drift.
        unforced: Motion of the module's tree at x_ddot = 0.
    """

    basis: Basis
    unforced: Motion


@dataclass(eq=False)
class ArticulatedModule:
    """One module after the backward recursion.

    Attributes:
        state: The module's state.
        basis: Basis of its motions and drift.
        unforced: Motion of its tree at x_ddot = 0.
        a_maps: For each output, a_o, shape (T, 6, N), Eq. (2).
        c: For each output, v_dot_0 + crm(V) v, shape (T, 6) (`ModuleState.convective`).
        X: For each output, the motion matrix from the base, shape (T, 6, 6), Eq. (26).
        G: A_t^-1 E, shape (T, N, 6).
        Q_0: Generalised force if the base has no acceleration, shape (T, N), Eq. (44).
        y: A_t^-1 Q_0, shape (T, N): u_dot if the base has no acceleration.
        inertia: Cholesky factor of A_t.
        terms: Largest term in the sum y, shape (T,).
    """

    state: ModuleState
    basis: Basis
    unforced: Motion
    a_maps: list[Array]
    c: list[Array]
    X: list[Array]
    G: Array
    Q_0: Array
    y: Array
    inertia: InertiaFactor
    terms: Array


def articulate(
    robot: HybridRobot,
    states: list[ModuleState],
    loads: Loads,
    tau: Array,
    prescribed: Array | None,
    *,
    passing: bool = False,
) -> list[ArticulatedModule]:
    """Run the backward recursion: compute articulated inertias and biases, the outermost modules first.

    Args:
        states: States of its modules.
        loads: External wrenches and effects.
        tau: Motor efforts, shape (T, motors).
        prescribed: Accelerations, shape (T, nv), whose entries for motors are prescribed, or None.
        passing: At postures of lost rank, use the motions of the branch that the velocity belongs to.
    """
    T = len(tau)
    I_star = [np.tile(s.mechanism.inertias, (T, 1, 1, 1)) for s in states]
    noise = [np.zeros_like(x) for x in I_star]
    beta_star = [_own_bias(s, loads.modules[k], loads.on) for k, s in enumerate(states)]
    out: list[ArticulatedModule] = []
    for k in reversed(range(len(states))):
        s, legs = states[k], leg_terms(states[k], loads, k)
        wanted = None if prescribed is None else prescribed[:, s.module.v_index]
        motions = _motions(s, wanted, passing)
        noise[k] += rounding_of(I_star[k])
        efforts = tau[:, s.module.motor_index]
        item = _articulate_module(s, legs, I_star[k], beta_star[k], efforts, motions, noise[k])
        out.insert(0, item)
        if s.module.parent >= 0:
            base, output = s.module.parent, s.module.parent_output
            inertia, bias, rounding = _onto_base(item, legs, I_star[k], beta_star[k], noise[k])
            noise[base][:, output] += rounding
            I_star[base][:, output] += inertia
            beta_star[base][:, output] += bias
    return out


def _articulate_module(
    s: ModuleState,
    legs: LegTerms,
    I_star: Array,
    beta_star: Array,
    tau: Array,
    motions: Motions,
    rounding: Array,
) -> ArticulatedModule:
    """Solve one module for u_dot as a function of its base's acceleration, Eqs. (40)-(44).

    Args:
        s: State of the module.
        legs: Inertia and forces of its legs.
        I_star: Articulated inertias of its outputs, shape (T, outputs, 6, 6).
        beta_star: Biases of its outputs, shape (T, outputs, 6).
        tau: Efforts of its motors, shape (T, motors).
        motions: Its motions (`_motions`).
        rounding: Upper bounds on the rounding of I_star, as inertias, shape (T, outputs, 6, 6).

    Raises:
        SingularityError: Its closures lose rank, or a force acts on a motion without inertia.
    """
    basis, unforced = motions.basis, motions.unforced
    check_closure_rank(s.module, basis)
    x = balance_of_legs(s, legs, basis, tau)
    a_maps: list[Array] = []
    cs: list[Array] = []
    Xs: list[Array] = []
    for o, body in enumerate(s.mechanism.spec.outputs):
        J = s.mechanism.jacobian(s.motion, body)
        a_map, X = np.matmul(J, basis.Psi), motion_matrix(*s.placement(o))
        c = np.einsum("tij,tj->ti", J, basis.drift) + unforced.acceleration(body) + s.convective[:, o]
        b = np.einsum("tij,tj->ti", I_star[:, o], c) + beta_star[:, o]
        x.add_output(a_map, X, I_star[:, o], b, rounding[:, o])
        a_maps, cs, Xs = [*a_maps, a_map], [*cs, c], [*Xs, X]
    noise = 4 * s.mechanism.tree.nv * EPS * x.noise + x.carried
    slips = slips_of(s, basis)
    rounded = np.diagonal(noise, axis1=1, axis2=2) + inertia_of_slips(s, legs, slips, I_star)
    inertia = factor_inertia(x.A_t, rounded)
    solved, left = inertia.solve(np.concatenate([x.E, x.Q_0[..., None]], axis=-1))
    slipping = force_of_slips(s, legs, slips, tau, beta_star)
    check_massless_forces(s.module, basis, left[..., 6], np.maximum(x.size, slipping / FORCED))
    G, y = solved[..., :6], solved[..., 6]
    return ArticulatedModule(
        s, basis, unforced, a_maps, cs, Xs, G, x.Q_0, y, inertia, size_of_solution(x, inertia, y)
    )


def _onto_base(
    item: ArticulatedModule, legs: LegTerms, I_star: Array, beta_star: Array, rounding: Array
) -> tuple[Array, Array, Array]:
    """Compute what a module adds to the inertia and bias of its base, Eqs. (45)-(48) in congruence form.

    Returns:
        Inertia, shape (T, 6, 6); bias, shape (T, 6); and an upper bound on the rounding of the inertia,
        shape (T, 6, 6), propagated like the inertia.
    """
    Psi, drift, G = item.basis.Psi, item.basis.drift, item.G
    T = len(G)
    with_base = np.concatenate([np.tile(np.eye(6), (T, 1, 1)), -np.matmul(Psi, G)], axis=1)
    inertia = congruence(with_base, legs.M)
    handed = cancelled_inertia(legs.M[:, 6:, 6:], np.abs(Psi) @ np.abs(G), Psi.shape[2])
    beta = np.einsum("tij,ti->tj", legs.M[:, 6:, :6], drift) + legs.p + np.einsum("tij,ti->tj", G, item.Q_0)
    for o, (X, a_map, c) in enumerate(zip(item.X, item.a_maps, item.c, strict=True)):
        follows = X - np.matmul(a_map, G)
        inertia += congruence(follows, I_star[:, o])
        handed += congruence(follows, rounding[:, o])
        handed += cancelled_inertia(I_star[:, o], np.abs(X) + np.abs(a_map) @ np.abs(G), Psi.shape[2])
        b = np.einsum("tij,tj->ti", I_star[:, o], c) + beta_star[:, o]
        beta += np.einsum("tij,ti->tj", X, b)
    return inertia, beta, handed


def accelerate(
    robot: HybridRobot, modules: list[ArticulatedModule], root: Array, q: Array, v: Array, a: Array
) -> None:
    """Run the last forward recursion: compute the accelerations of the spanning tree, Eqs. (51), (53).

    Args:
        modules: Its modules after `articulate`.
        root: Acceleration of the base of the first modules minus gravity, shape (T, 6).
        q: Positions, shape (T, nq).
        v: Rates, shape (T, nv).
        a: Accelerations, shape (T, nv), filled in place.
    """
    outputs: list[list[Array]] = []
    gravity = float(np.linalg.norm(robot.gravity))
    for item in modules:
        s, module = item.state, item.state.module
        m = s.mechanism
        V_dot = root if module.parent < 0 else outputs[module.parent][module.parent_output]
        carried = np.einsum("tij,tj->ti", item.G, V_dot)
        u_dot = item.y - carried  # Eq. (51)
        choose_least_norm(module, item.basis, item.inertia, u_dot)
        outputs.append(
            [
                np.einsum("tij,tj->ti", X, V_dot) + np.einsum("tij,tj->ti", a_map, u_dot) + c  # Eq. (53)
                for X, a_map, c in zip(item.X, item.a_maps, item.c, strict=True)
            ]
        )
        x_ddot = np.einsum("tij,tj->ti", item.basis.Psi, u_dot) + item.basis.drift
        warn_of_lost_accelerations(module, x_ddot, item.terms + largest(carried), gravity)
        spanning = np.zeros((len(q), m.spanning.nv))
        m.cut.to_spanning(x_ddot, spanning)
        if m.spec.wrists:
            target = m.tree.sweep(s.q, s.v, x_ddot, item.unforced)
            own = q[:, module.q_index], v[:, module.v_index]
            m.wrists.recover_accelerations(*own, spanning, target, s.spanning)
        a[:, module.v_index] = spanning


def _own_bias(state: ModuleState, load: ModuleLoad, on: Effects) -> Array:
    """Compute crf(V)(I V) + F_e of every output, shape (T, outputs, 6), Eq. (38)."""
    out = np.zeros_like(state.outputs)
    for o, inertia in enumerate(state.mechanism.inertias):
        V = state.outputs[:, o]
        out[:, o] = on.body_bias(V, inertia) - load.on_output(state, o)
    return out


def _motions(state: ModuleState, prescribed: Array | None, passing: bool) -> Motions:
    """Compute the motions of a module.

    Args:
        state: State of the module.
        prescribed: Accelerations of its spanning tree, shape (T, nv), whose entries for motors are
            prescribed, or None.
        passing: At postures of lost rank, use the motions of the branch that the velocity belongs to.

    Raises:
        SingularityError: The accelerations of the motors do not determine the motion.
    """
    m = state.mechanism
    unforced = m.tree.sweep(state.q, state.v)
    basis = m.basis(state.K, m.closures.rates(unforced, state.v)[1])
    if passing:
        basis = along_branch(state, basis)
    motors = state.module.motor_columns
    if prescribed is None or not len(motors):
        return Motions(basis, unforced)
    wanted = np.zeros((len(prescribed), m.tree.nv))
    m.cut.to_tree(prescribed, wanted)
    unit = m.reduction.col_scale[motors]
    S_Psi = basis.Psi[:, motors] / unit[:, None]
    miss = (basis.drift[:, motors] - wanted[:, motors]) / unit
    Z, u_dot, pivot = null_basis(S_Psi, miss, min(S_Psi.shape[1:]))
    check_motor_map(state.module, pivot)
    Psi = np.matmul(basis.Psi, Z)
    drift = basis.drift + np.einsum("tij,tj->ti", basis.Psi, u_dot)
    return Motions(Basis(Psi, drift, basis.pivot), unforced)
