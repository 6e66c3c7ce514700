"""Direct dynamic model: accelerations from motor efforts, Eqs. (38)-(53) in their general form.

Three recursions: forward for placements and twists (`forward`), backward for articulated inertias
(`articulate`), forward for accelerations (`accelerate`). The congruence form of Eqs. (45), (47) keeps every
articulated inertia positive semidefinite; the paper's S2, S3, K, alpha are never formed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, overload

import numpy as np
from numpy.typing import ArrayLike

from .effects.choice import Choice, Effects, choose, times
from .elimination import least_squares, null_basis
from .errors import ModelError, SingularityError, TrajectoryError
from .forward import ModuleState, as_batch, base_motion, check_closed, forward
from .idm import reactions_of
from .inertia_solve import EPS, InertiaFactor, factor_inertia
from .loads import Loads, ModuleLoad, all_loads
from .lost_rank import refuse_lost_rank
from .module import Module
from .reactions import Reactions
from .reduction import Basis
from .robot import HybridRobot
from .spatial import Array, crm, motion_matrix

#: Part of the largest term that a massless motion may be forced by before it is an error.
FORCED = 1e-9


@dataclass
class ArticulatedModule:
    """One module after the backward recursion.

    Attributes:
        state: The module's state.
        basis: Its motions and their drift.
        a_maps: For each output a_o, shape (T, 6, N), Eq. (2).
        c: For each output v_dot_0 + crm(V) v, shape (T, 6).
        X: For each output the motion matrix from the base, shape (T, 6, 6), Eq. (26).
        G: A_t^-1 E, shape (T, N, 6).
        y: A_t^-1 Q_0, shape (T, N): u_dot at a base without acceleration.
        inertia: The factor of A_t.
    """

    state: ModuleState
    basis: Basis
    a_maps: list[Array]
    c: list[Array]
    X: list[Array]
    G: Array
    y: Array
    inertia: InertiaFactor


@overload
def ddm(
    robot: HybridRobot, q: Array, v: Array, tau: Array, *, base_acceleration: Array | None = ...,
    wrenches: Mapping[str, Array] | None = ..., effects: Choice = ..., time: ArrayLike | None = ...,
    reactions: Literal[False] = ...,
) -> Array: ...  # fmt: skip
@overload
def ddm(
    robot: HybridRobot, q: Array, v: Array, tau: Array, *, base_acceleration: Array | None = ...,
    wrenches: Mapping[str, Array] | None = ..., effects: Choice = ..., time: ArrayLike | None = ...,
    reactions: Literal[True],
) -> tuple[Array, Reactions]: ...  # fmt: skip
def ddm(
    robot: HybridRobot,
    q: Array,
    v: Array,
    tau: Array,
    *,
    base_acceleration: Array | None = None,
    wrenches: Mapping[str, Array] | None = None,
    effects: Choice = None,
    time: ArrayLike | None = None,
    reactions: bool = False,
) -> Array | tuple[Array, Reactions]:
    """Give the accelerations of a robot under motor efforts.

    u_dot = A_t^-1 (Q_0 - E V_dot_base), module after module, Eqs. (40), (51).

    Args:
        robot: The robot.
        q: Positions of the spanning tree, shape (nq,) or (T, nq).
        v: Rates, shape (nv,) or (T, nv), [m/s, rad/s].
        tau: Efforts in the order of `robot.motors`, shape (motors,) or (T, motors), [N or N m].
        base_acceleration: Spatial acceleration of a "moving" base in its own frame (Pinocchio's, the first
            six of a), shape (6,) or (T, 6); zero where left out.
        wrenches: For each link a wrench ON it, shape (6,) or (T, 6), [N, N m], in the link's frame at its
            origin.
        effects: What is computed: None for gravity, inertia, the legs' inertia and velocity terms; "model"
            for those and all that the robot's files state; or names and objects (`hybridyn.effects`), and
            nothing else.
        time: Time of each sample, shape () or (T,), [s], for effects that follow a table.
        reactions: Also give the wrenches between modules and in the closures.

    Returns:
        Accelerations of the spanning tree, shape (nv,) or (T, nv), [m/s^2, rad/s^2]; with `reactions=True`
        also a `Reactions`. Motions without inertia that nothing forces take least-norm accelerations.

    Raises:
        AssemblyError: The state does not close the loops.
        SingularityError: A force acts on a motion without inertia.
        ModelError: Effects that are unknown, without numbers or contradict each other; no inertia.
        TrajectoryError: Arrays of the wrong shape, or not finite; an unknown link; a table too short.

    Source:
        Ibrahim & Khalil (2010), Eqs. (38)-(53). The paper drops a_dot v_r from xi; `Basis.drift` keeps it.
    """
    q, single = as_batch(q, robot.nq, "q")
    v, tau = as_batch(v, robot.nv, "v")[0], as_batch(tau, len(robot.motors), "tau")[0]
    if not len(q) == len(v) == len(tau):
        raise TrajectoryError(f"q, v, tau have {len(q)}, {len(v)}, {len(tau)} samples")
    on, time = choose(robot, effects), times(time, len(q))
    _needs_inertia(on)
    a = np.zeros_like(v)
    if base_acceleration is not None:
        if robot.base != "moving":
            raise TrajectoryError("base_acceleration is for base='moving'")
        given, one = as_batch(base_acceleration, 6, "base_acceleration")
        if not one and len(given) != len(q):
            raise TrajectoryError(f"base_acceleration has shape {given.shape}; wanted (6,) or ({len(q)}, 6)")
        a[:, :6] = given
    if on.base is not None:
        q, v, a = on.base.into(robot, time, q, v, a)
    if on.limits is not None:
        tau = on.limits.clip(robot, tau)
    loads = all_loads(robot, on, q, v, time, wrenches)
    states = forward(robot, q, v, None, on.gravity)
    check_closed(robot, states, q, accelerations=False)
    modules = articulate(robot, states, loads, tau, None)
    accelerate(robot, modules, base_motion(robot, q, v, a, on.gravity)[1], q, v, a)
    if not reactions:
        return a[0] if single else a
    result = reactions_of(robot, q, v, a, tau, loads)
    return (a[0], result.sample(0)) if single else (a, result)


def _needs_inertia(on: Effects) -> None:
    """Refuse a direct model without inertia.

    Raises:
        ModelError: There is none.
    """
    if on.inertia is None:
        raise ModelError(
            "the direct model needs the effect 'inertia': without it efforts make no accelerations; the inverse "
            "model does statics", element="inertia",
        )  # fmt: skip


def solve_passive(robot: HybridRobot, q: Array, v: Array, a: Array, loads: Loads) -> Array:
    """Give the accelerations whose motors' (and prescribed base's) entries are those of `a`, the rest unforced.

    The same two sweeps with Psi Z, the prescribed part in the drift, and no motor effort: Z spans what the
    motors leave free.

    Args:
        robot: The robot.
        q: Positions, shape (T, nq).
        v: Rates, shape (T, nv).
        a: Accelerations, shape (T, nv).
        loads: External wrenches.
    """
    _needs_inertia(loads.on)
    states = forward(robot, q, v, None, loads.on.gravity)
    check_closed(robot, states, q, accelerations=False)
    modules = articulate(robot, states, loads, np.zeros((len(q), len(robot.motors))), a)
    out = np.zeros_like(a)
    if robot.base == "moving":
        out[:, :6] = a[:, :6]
    accelerate(robot, modules, base_motion(robot, q, v, a, loads.on.gravity)[1], q, v, out)
    return out


def articulate(
    robot: HybridRobot, states: list[ModuleState], loads: Loads, tau: Array, prescribed: Array | None
) -> list[ArticulatedModule]:
    """Run the backward recursion: articulated inertias and biases, from the outermost modules inwards.

    Args:
        robot: The robot.
        states: Its modules' states.
        loads: External wrenches.
        tau: Motor efforts, shape (T, motors).
        prescribed: Accelerations of which the motors' entries are prescribed, shape (T, nv), or None.
    """
    T = len(tau)
    I_star = [np.tile(s.mechanism.inertias, (T, 1, 1, 1)) for s in states]
    beta_star = [_own_bias(s, loads.modules[k], loads.on) for k, s in enumerate(states)]
    out: list[ArticulatedModule] = []
    for k in reversed(range(len(states))):
        s = states[k]
        m, n = s.mechanism, s.mechanism.tree.nv
        basis, bias = _motions(s, None if prescribed is None else prescribed[:, s.module.v_index])
        refuse_lost_rank(s.module, basis)
        Psi, drift = basis.Psi, basis.drift
        M_leg = loads.on.leg_matrix(s)  # Eqs. (63)-(75)
        if (rotor := loads.rotor_diagonal(s)) is not None:
            M_leg[:, 6:, 6:] += np.diag(rotor)
        p, h = loads.on.leg_bias(s)  # Eqs. (71)-(73)
        f_base, f_legs = loads.on_legs(k, s)
        A, D = M_leg[:, 6:, 6:], M_leg[:, 6:, :6]
        A_t = _congruence(Psi, A)  # Eq. (43), the legs' share
        noise = _congruence(np.abs(Psi), np.abs(A))
        E = np.einsum("tij,tik->tjk", Psi, D)  # Eq. (42)
        needed = f_legs - h - np.einsum("tij,tj->ti", A, drift)
        needed[:, s.module.motor_columns] += tau[:, s.module.motor_index]
        Q_0 = np.einsum("tij,ti->tj", Psi, needed)  # Eq. (44) and the motors
        size = _size(Psi, np.abs(needed) + np.abs(h) + np.abs(f_legs))
        a_maps, cs, Xs = [], [], []
        for o, body in enumerate(m.spec.outputs):
            J = m.jacobian(s.motion, body)
            a_map, X = np.matmul(J, Psi), motion_matrix(*s.placement(o))
            c = np.einsum("tij,tj->ti", J, drift) + bias[o] + crm(s.outputs[:, o], s.motion.twist(body))
            I_o = I_star[k][:, o]
            b = np.einsum("tij,tj->ti", I_o, c) + beta_star[k][:, o]
            A_t += _congruence(a_map, I_o)
            noise += _congruence(np.abs(a_map), np.abs(I_o))
            E += np.einsum("tij,tik,tkl->tjl", a_map, I_o, X, optimize=True)
            Q_0 -= np.einsum("tij,ti->tj", a_map, b)
            size = np.maximum(size, _size(a_map, np.abs(b)))
            a_maps, cs, Xs = [*a_maps, a_map], [*cs, c], [*Xs, X]
        inertia = factor_inertia(A_t, 4 * n * EPS * np.diagonal(noise, axis1=1, axis2=2))
        solved, left = inertia.solve(np.concatenate([E, Q_0[..., None]], axis=-1))
        _refuse_forced(s.module, basis, inertia, left, size)
        module = ArticulatedModule(s, basis, a_maps, cs, Xs, solved[..., :6], solved[..., 6], inertia)
        out.insert(0, module)
        if s.module.parent >= 0:
            to = (s.module.parent, s.module.parent_output)
            inertia_base, beta_base = _onto_base(module, I_star[k], beta_star[k], M_leg, p - f_base, Q_0)
            I_star[to[0]][:, to[1]] += inertia_base
            beta_star[to[0]][:, to[1]] += beta_base
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
    for item in modules:
        s, module = item.state, item.state.module
        m = s.mechanism
        V_dot = root if module.parent < 0 else outputs[module.parent][module.parent_output]
        u_dot = item.y - np.einsum("tij,tj->ti", item.G, V_dot)  # Eq. (51)
        _least_norm(item, u_dot)
        outputs.append(
            [
                np.einsum("tij,tj->ti", X, V_dot) + np.einsum("tij,tj->ti", a_map, u_dot) + c  # Eq. (53)
                for X, a_map, c in zip(item.X, item.a_maps, item.c, strict=True)
            ]
        )
        x_ddot = np.einsum("tij,tj->ti", item.basis.Psi, u_dot) + item.basis.drift
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


def _motions(state: ModuleState, prescribed: Array | None) -> tuple[Basis, list[Array]]:
    """Give a module's motions, and its outputs' accelerations at zero x_ddot (own frames, shape (T, 6))."""
    m = state.mechanism
    motion = m.tree.sweep(state.q, state.v)
    basis = m.basis(state.K, m.closures.rates(motion, state.v)[1])
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
    Psi = np.matmul(basis.Psi, Z)
    drift = basis.drift + np.einsum("tij,tj->ti", basis.Psi, u_dot)
    return Basis(Psi, drift, np.minimum(basis.pivot, pivot)), bias


def _congruence(B: Array, M: Array) -> Array:
    """Give B^T M B, shapes (T, n, N) and (T, n, n)."""
    out: Array = np.matmul(np.swapaxes(B, 1, 2), np.matmul(M, B))
    return out


def _onto_base(
    module: ArticulatedModule, I_star: Array, beta_star: Array, M_leg: Array, p: Array, Q_0: Array
) -> tuple[Array, Array]:
    """Give what a module adds to its base's articulated inertia and bias, Eqs. (45)-(48) in congruence form."""
    Psi, drift, G = module.basis.Psi, module.basis.drift, module.G
    T = len(G)
    with_base = np.concatenate([np.tile(np.eye(6), (T, 1, 1)), -np.matmul(Psi, G)], axis=1)
    inertia = _congruence(with_base, M_leg)
    beta = np.einsum("tij,ti->tj", M_leg[:, 6:, :6], drift) + p + np.einsum("tij,ti->tj", G, Q_0)
    for o, (X, a_map, c) in enumerate(zip(module.X, module.a_maps, module.c, strict=True)):
        inertia += _congruence(X - np.matmul(a_map, G), I_star[:, o])
        b = np.einsum("tij,tj->ti", I_star[:, o], c) + beta_star[:, o]
        beta += np.einsum("tij,ti->tj", X, b)
    return inertia, beta


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
