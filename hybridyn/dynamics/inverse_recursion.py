"""The backward recursion of the inverse model, Eqs. (30)-(33)."""

from __future__ import annotations

import numpy as np

from ..spatial import Array, wrench_to_base
from ..structure.robot import HybridRobot
from ..structure.state import ModuleState
from .actuation import Need, Sharing, motor_efforts
from .forward import base_motion, forward
from .loads import Loads
from .lost_digits import flag_efforts, robot_weight
from .lost_rank import LOST_PIVOT, along_motion, possible_motions, refuse_lost_digits, refuse_lost_rank
from .natural_sizes import force_rounding
from .reactions import Reactions, module_reactions


def reactions_of(robot: HybridRobot, q: Array, v: Array, a: Array, tau: Array, loads: Loads) -> Reactions:
    """Return the wrenches between modules and in the closures of a motion under known efforts."""
    result, on = Reactions.empty(len(q)), loads.on
    states = forward(robot, q, v, a, on.gravity, classical=on.velocity is not None)
    backward(robot, states, loads, None, tau, result, (q, v, a))
    return result


def backward(
    robot: HybridRobot,
    states: list[ModuleState],
    loads: Loads,
    sharing: Sharing | None,
    tau: Array,
    result: Reactions | None,
    given: tuple[Array, Array, Array],
) -> None:
    """Run the backward recursion: from what each output must receive to efforts and the base's wrench.

    Fills in `tau` (unless `sharing` is None: efforts are known) and `result` (unless None).
    """
    T = len(given[0])
    # For every output the sum of its children's F_k, in its frame; the same without cancellation, as work.
    received = [np.zeros((T, len(s.module.outputs), 6)) for s in states]
    summed = [np.zeros((T, len(s.module.outputs))) for s in states]
    root = np.zeros((T, 6))
    weight, rounding = robot_weight(robot), force_rounding(robot, *given[1:])
    for k in reversed(range(len(states))):
        s, load = states[k], loads.modules[k]
        m = s.mechanism
        F_b, H = loads.on.leg_forces(s)  # Eqs. (54)-(62)
        f_base, f_legs = loads.on_legs(k, s)
        F, H = F_b - f_base, H - f_legs
        if (rotor := loads.rotor_diagonal(s)) is not None:
            H += rotor * s.a
        basis = m.basis(s.K)
        if sharing is not None and sharing.on_singular == "raise":
            refuse_lost_rank(s.module, basis)
        basis = along_motion(s, basis)
        Psi = basis.Psi
        Q = np.einsum("tij,ti->tj", Psi, H)
        size = _terms(m.reduction.col_scale, H)
        for o, body in enumerate(m.spec.outputs):
            inertia, V = m.inertias[o], s.outputs[:, o]
            F_p = s.outputs_dot[:, o] @ inertia + loads.on.body_bias(V, inertia)  # Eq. (30)
            W = F_p - load.on_output(s, o) + received[k][:, o]  # Eqs. (31), (32)
            J = m.jacobian(s.motion, body)
            H = H + np.einsum("tij,ti->tj", J, W)
            size = size + _work(F_p, m.length) + _work(load.on_output(s, o), m.length) + summed[k][:, o]
            Q += np.einsum("tij,ti->tj", np.matmul(J, Psi), W)  # Eqs. (16), (33) before the motors
            F += wrench_to_base(*s.placement(o), W)
        if sharing is not None:
            refuse_lost_digits(s.module, basis, Q, size, weight * m.length)
            flag_efforts(s.module, Q, size, weight * m.length)
            need = Need(Q, size, rounding, s.motion)
            tau[:, s.module.motor_index] = motor_efforts(robot, s.module, Psi, need, sharing)  # Eq. (33)
            for t in np.flatnonzero(basis.pivot < LOST_PIVOT) if m.reduction.rank else ():
                at = slice(t, t + 1)
                every = possible_motions(s.module, s.K[t])[None]
                Q_all = np.einsum("tij,ti->tj", every, H[at])
                need = Need(Q_all, size[at], rounding[at], s.motion.take(np.array([t])))
                tau[t, s.module.motor_index] = motor_efforts(robot, s.module, every, need, sharing)[0]
        if result is not None:
            module_reactions(result, s, load, F, H, tau[:, s.module.motor_index])
        if s.module.parent < 0:
            root += F
        else:
            received[s.module.parent][:, s.module.parent_output] += F
            summed[s.module.parent][:, s.module.parent_output] += size
    if result is not None:
        result.base[:] = root + _root_body(robot, loads, given)


def _terms(col_scale: Array, H: Array) -> Array:
    """Return the largest generalised force as work per scaled coordinate, shape (T,), [N m]."""
    out: Array = np.abs(H * col_scale).max(axis=1, initial=0.0)
    return out


def _work(W: Array, length: float) -> Array:
    """Return the size of a wrench as work per scaled coordinate, shape (T,), [N m]."""
    out: Array = np.linalg.norm(W[:, :3], axis=1) * length + np.linalg.norm(W[:, 3:], axis=1)
    return out


def _root_body(robot: HybridRobot, loads: Loads, given: tuple[Array, Array, Array]) -> Array:
    """Return what the root body itself must receive (a free base has it in its module)."""
    if robot.base == "floating":
        return np.zeros_like(loads.root)
    V, V_dot = base_motion(robot, *given, loads.on.gravity, classical=loads.on.velocity is not None)
    I0 = robot.root_inertia
    return V_dot @ I0 + loads.on.body_bias(V, I0) - loads.root
