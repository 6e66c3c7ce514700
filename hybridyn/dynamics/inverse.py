"""Inverse dynamic model: motor efforts from a motion, Eqs. (30)-(33) in their general form."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal, overload

import numpy as np
from numpy.typing import ArrayLike

from ..effects.choice import Choice, choose, times
from ..errors import ActuationError, TrajectoryError
from ..spatial import Array, wrench_to_base
from ..structure.robot import HybridRobot
from .actuation import Sharing, motor_efforts
from .forward import ModuleState, as_batch, base_motion, forward, same_samples
from .loads import Loads, all_loads
from .lost_digits import flag_efforts, robot_weight
from .lost_rank import LOST, along_motion, possible_motions, refuse_lost_digits, refuse_lost_rank
from .reactions import Reactions, module_reactions
from .state_checks import check_closed

#: What to advise where a passive motion would need an effort.
HINT = 'Give the accelerations that need no effort there, or pass passive="solved"'


@overload
def idm(
    robot: HybridRobot, q: Array, v: Array, a: Array, *, wrenches: Mapping[str, Array] | None = ...,
    effects: Choice = ..., time: ArrayLike | None = ..., passive: str = ...,
    weights: Mapping[str, float] | Array | None = ...,
    on_singular: str = ..., reactions: Literal[False] = ...,
) -> Array: ...  # fmt: skip
@overload
def idm(
    robot: HybridRobot, q: Array, v: Array, a: Array, *, wrenches: Mapping[str, Array] | None = ...,
    effects: Choice = ..., time: ArrayLike | None = ..., passive: str = ...,
    weights: Mapping[str, float] | Array | None = ...,
    on_singular: str = ..., reactions: Literal[True],
) -> tuple[Array, Reactions]: ...  # fmt: skip
def idm(
    robot: HybridRobot,
    q: Array,
    v: Array,
    a: Array,
    *,
    wrenches: Mapping[str, Array] | None = None,
    effects: Choice = None,
    time: ArrayLike | None = None,
    passive: str = "given",
    weights: Mapping[str, float] | Array | None = None,
    on_singular: str = "raise",
    reactions: bool = False,
) -> Array | tuple[Array, Reactions]:
    """Give the motor efforts that move a robot as prescribed.

    B tau = Psi^T H + sum_o a_o^T W_o, module after module from the outermost inwards, Eqs. (16), (31)-(33).

    Args:
        robot: The robot.
        q: Positions of the spanning tree, shape (nq,) or (T, nq).
        v: Rates, shape (nv,) or (T, nv), [m/s, rad/s].
        a: Accelerations, shape (nv,) or (T, nv), [m/s^2, rad/s^2].
        wrenches: For each link a wrench ON it, shape (6,) or (T, 6), [N, N m], in the link's frame at its
            origin.
        effects: What is computed: None for gravity, inertia, the legs' inertia and velocity terms; "model"
            for those and all that the robot's files state; or names and objects (`hybridyn.effects`), and
            nothing else.
        time: Time of each sample, shape () or (T,), [s], for effects that follow a table.
        passive: "given": `a` is taken as it comes, and a passive motion that would need an effort is an
            error. "solved": only the motors' accelerations (and a prescribed base's) count, the rest follows
            from zero effort.
        weights: For each motor w in the sum of w x effort^2 that redundant motors make least, by name or in
            the order of `robot.motors`; by effort limits where left out.
        on_singular: "raise", or "least-norm" to go on with the least efforts where motors lose a direction,
            and with those of the branch that v is on where closures lose rank.
        reactions: Also give the wrenches between modules and in the closures.

    Returns:
        Efforts in the order of `robot.motors`, shape (motors,) or (T, motors), [N or N m]; with
        `reactions=True` also a `Reactions`.

    Raises:
        AssemblyError: The state does not close the loops.
        SingularityError: The motors lose a direction, or closures lose rank, and `on_singular` is "raise"; no
            digit of the efforts is left next to lost rank; or a velocity lies on no branch there.
        ActuationError: A passive motion would need an effort.
        ModelError: Effects that are unknown, without numbers, or contradict each other.
        TrajectoryError: Arrays of the wrong shape, or not finite; an unknown link; a table too short.

    Source:
        Ibrahim & Khalil (2010), Eqs. (30)-(33); trees of modules, any mobility and number of motors are ours.
    """
    q, single = as_batch(q, robot.nq, "q")
    v, a = as_batch(v, robot.nv, "v")[0], as_batch(a, robot.nv, "a")[0]
    same_samples(q=q, v=v, a=a)
    _one_of("on_singular", on_singular, "raise", "least-norm")
    _one_of("passive", passive, "given", "solved")
    on, time = choose(robot, effects), times(time, len(q))
    if on.base is not None:
        q, v, a = on.base.into(robot, time, q, v, a)
    loads = all_loads(robot, on, q, v, time, wrenches)
    if passive == "solved":
        from .direct import solve_passive

        a = solve_passive(robot, q, v, a, loads)
    v, a = on.inertia.motion(v, a) if on.inertia else (np.zeros_like(v), np.zeros_like(a))
    states = forward(robot, q, v, a, on.gravity, classical=on.velocity is not None)
    check_closed(states, q, accelerations=True)
    sharing = Sharing(_weights(robot, weights), on_singular, HINT if passive == "given" else "")
    result = Reactions.empty(len(q)) if reactions else None
    tau = np.zeros((len(q), len(robot.motors)))
    _backward(robot, states, loads, sharing, tau, result, (q, v, a))
    if on.limits is not None:
        on.limits.check(robot, tau)
    if result is None:
        return tau[0] if single else tau
    return (tau[0], result.sample(0)) if single else (tau, result)


def _one_of(name: str, value: str, *allowed: str) -> None:
    """Refuse a value that is not allowed.

    Raises:
        TrajectoryError: With those that are.
    """
    if value not in allowed:
        raise TrajectoryError(f"{name} must be {' or '.join(map(repr, allowed))}, not {value!r}")


def reactions_of(robot: HybridRobot, q: Array, v: Array, a: Array, tau: Array, loads: Loads) -> Reactions:
    """Give the wrenches between modules and in the closures of a motion under known efforts."""
    result, on = Reactions.empty(len(q)), loads.on
    states = forward(robot, q, v, a, on.gravity, classical=on.velocity is not None)
    _backward(robot, states, loads, None, tau, result, (q, v, a))
    return result


def _backward(
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
    weight = robot_weight(robot)
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
            tau[:, s.module.motor_index] = motor_efforts(robot, s.module, Psi, Q, size, sharing)  # Eq. (33)
            for t in np.flatnonzero(basis.pivot < LOST) if m.reduction.rank else ():
                at = slice(t, t + 1)
                every = possible_motions(s.module, s.K[t])[None]
                needed = np.einsum("tij,ti->tj", every, H[at])
                tau[t, s.module.motor_index] = motor_efforts(
                    robot, s.module, every, needed, size[at], sharing
                )[0]
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
    """Give the largest generalised force as work per scaled coordinate, shape (T,), [N m]."""
    out: Array = np.abs(H * col_scale).max(axis=1, initial=0.0)
    return out


def _work(W: Array, length: float) -> Array:
    """Give the size of a wrench as work per scaled coordinate, shape (T,), [N m]."""
    out: Array = np.linalg.norm(W[:, :3], axis=1) * length + np.linalg.norm(W[:, 3:], axis=1)
    return out


def _root_body(robot: HybridRobot, loads: Loads, given: tuple[Array, Array, Array]) -> Array:
    """Give what the root body itself must receive (a free base has it in its module)."""
    if robot.base == "floating":
        return np.zeros_like(loads.root)
    V, V_dot = base_motion(robot, *given, loads.on.gravity, classical=loads.on.velocity is not None)
    I0 = robot.root_inertia
    return V_dot @ I0 + loads.on.body_bias(V, I0) - loads.root


def _weights(robot: HybridRobot, weights: Mapping[str, float] | Array | None) -> Array | None:
    """Give weights in the order of the motors.

    Raises:
        ActuationError: A weight is missing, unknown or not positive.
    """
    if weights is None:
        return None
    if isinstance(weights, Mapping):
        unknown = sorted(set(weights) - set(robot.motors))
        missing = [m for m in robot.motors if m not in weights]
        if unknown or missing:
            raise ActuationError(f"weights: unknown motors {unknown}, missing motors {missing}")
        weights = np.array([weights[m] for m in robot.motors])
    out = np.asarray(weights, dtype=float)
    if out.shape != (len(robot.motors),) or not (np.isfinite(out).all() and (out > 0).all()):
        raise ActuationError(f"weights must be {len(robot.motors)} positive numbers")
    return out
