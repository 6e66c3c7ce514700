"""The two recursions of the direct model: articulated inertias inwards, accelerations outwards.

The congruence form of Eqs. (45), (47) keeps every articulated inertia positive semidefinite; the paper's S2,
S3, K, alpha are never formed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .branch import along_branch
from .digits import flag_accelerations
from .effects.choice import Effects
from .elimination import least_squares, null_basis
from .errors import SingularityError
from .forward import ModuleState
from .inertia_solve import EPS, InertiaFactor, factor_inertia
from .loads import Loads, ModuleLoad
from .lost_rank import refuse_lost_rank, refuse_untold
from .module import Module
from .reduction import Basis
from .robot import HybridRobot
from .spatial import Array, motion_matrix

#: Part of the largest term that a massless motion may be forced by before it is an error.
FORCED = 1e-9


@dataclass(frozen=True)
class LegTerms:
    """What a module's legs bring, with their rotors and the loads on them.

    Attributes:
        M: Inertia over [V_dot_base; x_ddot], shape (T, 6 + n, 6 + n): A and D among it, Eqs. (63)-(75).
        p: Wrench on the base at zero accelerations less the loads', shape (T, 6), Eqs. (71)-(73).
        h: Generalised force along x at zero accelerations, shape (T, n).
        f: Generalised force of the loads along x, shape (T, n).
    """

    M: Array
    p: Array
    h: Array
    f: Array


@dataclass
class ArticulatedModule:
    """One module after the backward recursion.

    Attributes:
        state: The module's state.
        basis: Its motions and their drift.
        a_maps: For each output a_o, shape (T, 6, N), Eq. (2).
        c: For each output v_dot_0 + crm(V) v, shape (T, 6) (`ModuleState.convective`).
        X: For each output the motion matrix from the base, shape (T, 6, 6), Eq. (26).
        G: A_t^-1 E, shape (T, N, 6).
        Q_0: Generalised force at a base without acceleration, shape (T, N), Eq. (44).
        y: A_t^-1 Q_0, shape (T, N): u_dot at a base without acceleration.
        inertia: The factor of A_t.
        terms: Size of what y was summed from, shape (T,).
    """

    state: ModuleState
    basis: Basis
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
    """Run the backward recursion: articulated inertias and biases, from the outermost modules inwards.

    Args:
        robot: The robot.
        states: Its modules' states.
        loads: External wrenches.
        tau: Motor efforts, shape (T, motors).
        prescribed: Accelerations of which the motors' entries are prescribed, shape (T, nv), or None.
        passing: Whether postures of lost rank are passed through, on the branch that the velocity is on.
    """
    T = len(tau)
    I_star = [np.tile(s.mechanism.inertias, (T, 1, 1, 1)) for s in states]
    noise = [np.zeros_like(x) for x in I_star]
    beta_star = [_own_bias(s, loads.modules[k], loads.on) for k, s in enumerate(states)]
    out: list[ArticulatedModule] = []
    for k in reversed(range(len(states))):
        s, legs = states[k], _legs(states[k], loads, k)
        wanted = None if prescribed is None else prescribed[:, s.module.v_index]
        motions = _motions(s, wanted, passing)
        noise[k] += _rounding(I_star[k])
        efforts = tau[:, s.module.motor_index]
        item = _articulate_module(s, legs, I_star[k], beta_star[k], efforts, motions, noise[k])
        out.insert(0, item)
        if s.module.parent >= 0:
            base, output = s.module.parent, s.module.parent_output
            inertia, bias, blur = _onto_base(item, legs, I_star[k], beta_star[k], noise[k])
            noise[base][:, output] += blur
            I_star[base][:, output] += inertia
            beta_star[base][:, output] += bias
    return out


def _legs(state: ModuleState, loads: Loads, k: int) -> LegTerms:
    """Give what the legs of module k bring."""
    M = loads.on.leg_matrix(state)
    if (rotor := loads.rotor_diagonal(state)) is not None:
        M[:, 6:, 6:] += np.diag(rotor)
    p, h = loads.on.leg_bias(state)
    f_base, f = loads.on_legs(k, state)
    return LegTerms(M, p - f_base, h, f)


def _articulate_module(
    s: ModuleState,
    legs: LegTerms,
    I_star: Array,
    beta_star: Array,
    tau: Array,
    motions: tuple[Basis, list[Array]],
    blur: Array,
) -> ArticulatedModule:
    """Solve one module for u_dot over its base's acceleration, Eqs. (40)-(44).

    Args:
        s: The module's state.
        legs: What its legs bring.
        I_star: Articulated inertias of its outputs, shape (T, outputs, 6, 6).
        beta_star: Their biases, shape (T, outputs, 6).
        tau: Efforts of its motors, shape (T, motors).
        motions: Its motions, and its outputs' accelerations at zero x_ddot, as `_motions` gives them.
        blur: Rounding of I_star, as inertias that are no smaller, shape (T, outputs, 6, 6).

    Raises:
        SingularityError: Its closures lose rank, or a force acts on a motion without inertia.
    """
    m, n = s.mechanism, s.mechanism.tree.nv
    basis, bias = motions
    refuse_lost_rank(s.module, basis)
    Psi, drift = basis.Psi, basis.drift
    A, D = legs.M[:, 6:, 6:], legs.M[:, 6:, :6]
    A_t = _congruence(Psi, A)  # Eq. (43), the legs' share
    noise, carried = _congruence(np.abs(Psi), np.abs(A)), np.zeros_like(A_t)
    E = np.einsum("tij,tik->tjk", Psi, D)  # Eq. (42)
    needed = legs.f - legs.h - np.einsum("tij,tj->ti", A, drift)
    needed[:, s.module.motor_columns] += tau
    Q_0 = np.einsum("tij,ti->tj", Psi, needed)  # Eq. (44) and the motors
    size = _size(Psi, np.abs(needed) + np.abs(legs.h) + np.abs(legs.f))
    a_maps: list[Array] = []
    cs: list[Array] = []
    Xs: list[Array] = []
    for o, body in enumerate(m.spec.outputs):
        J = m.jacobian(s.motion, body)
        a_map, X = np.matmul(J, Psi), motion_matrix(*s.placement(o))
        c = np.einsum("tij,tj->ti", J, drift) + bias[o] + s.convective[:, o]
        I_o = I_star[:, o]
        b = np.einsum("tij,tj->ti", I_o, c) + beta_star[:, o]
        A_t += _congruence(a_map, I_o)
        noise += _congruence(np.abs(a_map), np.abs(I_o))
        carried += _congruence(a_map, blur[:, o])
        E += np.einsum("tij,tik,tkl->tjl", a_map, I_o, X, optimize=True)
        Q_0 -= np.einsum("tij,ti->tj", a_map, b)
        size = np.maximum(size, _size(a_map, np.abs(b)))
        a_maps, cs, Xs = [*a_maps, a_map], [*cs, c], [*Xs, X]
    inertia = factor_inertia(A_t, np.diagonal(4 * n * EPS * noise + carried, axis1=1, axis2=2))
    solved, left = inertia.solve(np.concatenate([E, Q_0[..., None]], axis=-1))
    _refuse_forced(s.module, basis, inertia, left, size)
    G, y = solved[..., :6], solved[..., 6]
    resisted = np.square(inertia.R[:, :1, :1].max(axis=(1, 2), initial=0.0))
    kept = _largest(Q_0)
    terms = _largest(y) * np.maximum(size / np.where(kept > 0, kept, np.inf), 1.0)
    terms = np.maximum(terms, size / np.where(resisted > 0, resisted, np.inf))
    return ArticulatedModule(s, basis, a_maps, cs, Xs, G, Q_0, y, inertia, terms)


def _onto_base(
    item: ArticulatedModule, legs: LegTerms, I_star: Array, beta_star: Array, blur: Array
) -> tuple[Array, Array, Array]:
    """Give what a module adds to its base's inertia and bias, Eqs. (45)-(48) in congruence form.

    The third result is the rounding of the inertias that it hands on, which takes their way.
    """
    Psi, drift, G = item.basis.Psi, item.basis.drift, item.G
    T = len(G)
    with_base = np.concatenate([np.tile(np.eye(6), (T, 1, 1)), -np.matmul(Psi, G)], axis=1)
    inertia, handed = _congruence(with_base, legs.M), np.zeros((T, 6, 6))
    beta = np.einsum("tij,ti->tj", legs.M[:, 6:, :6], drift) + legs.p + np.einsum("tij,ti->tj", G, item.Q_0)
    for o, (X, a_map, c) in enumerate(zip(item.X, item.a_maps, item.c, strict=True)):
        follows = X - np.matmul(a_map, G)
        inertia += _congruence(follows, I_star[:, o])
        handed += _congruence(follows, blur[:, o])
        b = np.einsum("tij,tj->ti", I_star[:, o], c) + beta_star[:, o]
        beta += np.einsum("tij,ti->tj", X, b)
    return inertia, beta, handed


def _rounding(inertia: Array) -> Array:
    """Give inertias, shape (T, outputs, 6, 6), no smaller than the rounding of some.

    Entries err by eps sqrt(I_ii I_jj) at most, and six times the diagonal is no smaller than that.
    """
    diagonal = np.diagonal(inertia, axis1=2, axis2=3)
    out: Array = 6 * EPS * np.abs(diagonal)[..., None] * np.eye(6)
    return out


def accelerate(
    robot: HybridRobot, modules: list[ArticulatedModule], root: Array, q: Array, v: Array, a: Array
) -> None:
    """Run the last forward recursion, Eqs. (51), (53), into the accelerations of the spanning tree.

    Args:
        robot: The robot.
        modules: Its modules after `articulate`.
        root: Acceleration of the first base less gravity, shape (T, 6).
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
        _least_norm(item, u_dot)
        outputs.append(
            [
                np.einsum("tij,tj->ti", X, V_dot) + np.einsum("tij,tj->ti", a_map, u_dot) + c  # Eq. (53)
                for X, a_map, c in zip(item.X, item.a_maps, item.c, strict=True)
            ]
        )
        x_ddot = np.einsum("tij,tj->ti", item.basis.Psi, u_dot) + item.basis.drift
        flag_accelerations(module, x_ddot, item.terms + _largest(carried), gravity)
        spanning = np.zeros((len(q), m.spanning.nv))
        m.take_legs(x_ddot, spanning)
        if m.spec.wrists:
            target = m.tree.sweep(s.q, s.v, x_ddot)
            m.recover_accelerations(q[:, module.q_index], v[:, module.v_index], spanning, target)
        a[:, module.v_index] = spanning


def _own_bias(state: ModuleState, load: ModuleLoad, on: Effects) -> Array:
    """Give crf(V)(I V) + F_e of every output, shape (T, outputs, 6), Eq. (38)."""
    out = np.zeros_like(state.outputs)
    for o, inertia in enumerate(state.mechanism.inertias):
        V = state.outputs[:, o]
        out[:, o] = on.body_bias(V, inertia) - load.on_output(state, o)
    return out


def _motions(state: ModuleState, prescribed: Array | None, passing: bool) -> tuple[Basis, list[Array]]:
    """Give a module's motions, and its outputs' accelerations at zero x_ddot (own frames, shape (T, 6)).

    Those of `prescribed`, shape (T, nv), or None, are the motions that leave the motors' accelerations as
    given.
    """
    m = state.mechanism
    motion = m.tree.sweep(state.q, state.v)
    basis = m.basis(state.K, m.closures.rates(motion, state.v)[1])
    if passing:
        basis = along_branch(state, basis)
    bias = [motion.acceleration(body) for body in m.spec.outputs]
    motors = state.module.motor_columns
    if prescribed is None or not len(motors):
        return basis, bias
    wanted = np.zeros((len(prescribed), m.tree.nv))
    m.give_legs(prescribed, wanted)
    unit = m.reduction.col_scale[motors]
    S_Psi = basis.Psi[:, motors] / unit[:, None]
    miss = (basis.drift[:, motors] - wanted[:, motors]) / unit
    Z, u_dot, pivot = null_basis(S_Psi, miss, min(S_Psi.shape[1:]))
    refuse_untold(state.module, pivot)
    Psi = np.matmul(basis.Psi, Z)
    drift = basis.drift + np.einsum("tij,tj->ti", basis.Psi, u_dot)
    return Basis(Psi, drift, basis.pivot), bias


def _congruence(B: Array, M: Array) -> Array:
    """Give B^T M B, shapes (T, n, N) and (T, n, n)."""
    out: Array = np.matmul(np.swapaxes(B, 1, 2), np.matmul(M, B))
    return out


def _largest(x: Array) -> Array:
    """Give the largest entry of each sample, shape (T,)."""
    out: Array = np.abs(x).max(axis=1, initial=0.0)
    return out


def _size(B: Array, force: Array) -> Array:
    """Give the largest term of B^T force, shape (T,)."""
    out: Array = np.einsum("tij,ti->tj", np.abs(B), np.abs(force)).max(axis=1, initial=0.0)
    return out


def _least_norm(item: ArticulatedModule, u_dot: Array) -> None:
    """Take the massless motions out of u_dot as far as they only make it longer."""
    unit = item.state.mechanism.reduction.col_scale
    for t in np.flatnonzero(item.inertia.massless):
        Psi = item.basis.Psi[t] / unit[:, None]
        null = item.inertia.null_space(int(t))
        x = Psi @ u_dot[t] + item.basis.drift[t] / unit
        u_dot[t] -= null @ least_squares((Psi @ null)[None], x[None])[0]


def _refuse_forced(module: Module, basis: Basis, inertia: InertiaFactor, left: Array, size: Array) -> None:
    """Refuse a force on a motion without inertia.

    Raises:
        SingularityError: Naming the motion.
    """
    force = np.abs(left[..., 6]).max(axis=1, initial=0.0)
    bad = np.flatnonzero(force > FORCED * size)
    if not len(bad):
        return
    t = int(bad[np.argmax(force[bad])])
    motion = basis.Psi[t, :, int(np.argmax(np.abs(left[t, :, 6])))] / module.mechanism.reduction.col_scale
    name = module.freedom_names()[int(np.argmax(np.abs(motion)))]
    raise SingularityError(
        f"module '{module.name}': the motion of {name} has no inertia, and a force of {force[t]:.3g} N m "
        f"acts on it at sample {t}: its acceleration is not defined. Give the bodies it moves a mass, or "
        "drive it by position",
        module=module.name,
        what="inertia",
        condition=np.inf,
        sample=t,
    )
