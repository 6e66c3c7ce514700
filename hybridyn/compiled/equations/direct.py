"""Write the direct model of one module: Eqs. (38)-(53) in the form of `hybridyn.dynamics.direct_recursion`.

One graph is cut into four stages: outwards (motion), inwards (articulated inertia), outwards (accelerations),
wrists. The module's quadratic form over s = [V_dot_base; y] is M, b. Its closures give y = Psi u_dot + Psi_b
V_dot_base + y_0, and u_dot = A_t^-1 (Q_0 - E V_dot_base).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np

from ...spatial import Index, crf, hat, wrench_to_base
from ...symbols import Expression, dot, minus, plus
from .chains import forces, mass_matrix, motion_map, wrench_map
from .core import Core, motions_of, own_inertia, rank_guard
from .direct_legs import LEG_SUMS
from .direct_outwards import accelerations_outwards, add_wrists, legs_on_paths
from .expressions import congruence, eye, pack, symmetric, symmetric_product, upper, zeros
from .factors import Handed, factored
from .held_loops import followed, opened_loops
from .idle.cores import rest_idle
from .least_inertia import NEARLY_NO_INERTIA, least_inertia
from .module_plan import ModulePlan
from .options import Options
from .rigid import classical, inertia_matrix, matrix_moved, momentum, moved, resting
from .rubbing import pushed_by
from .rubbing_legs import LegAnswers, read_legs
from .rubbing_moving import MovedModule, Needed, Solved
from .scales import squares
from .stages import Draft, GivenColumns, WrittenModule, begun, cut, read_by_core, twist_width


def quadratic_form(
    core: Core, plan: ModulePlan, options: Options, forced: list[int], received: GivenColumns
) -> tuple[tuple[Expression, Expression], list[Needed]]:
    """Compute (M, b): M, shape (6 + nv, 6 + nv), and b, shape (6 + nv,), and what each output needs.

    Args:
        options: Options of the direct model.
        forced: Freedoms of the core on which an effort acts.
        received: Filled with the columns of symbols that other kernels provide, by name.
    """
    chain, parts = core.chain, plan.parts
    tau = received.take("tau", len(forced))
    M, S1 = mass_matrix(chain)
    b = forces(chain) if options.velocity else zeros(6 + chain.nv)
    for k, col in enumerate(parts.tree_v):
        M[6 + k, 6 + k] = M[6 + k, 6 + k] + options.rotor[col]
    for i in sorted({group[0].platform for group in parts.groups}):
        S1 = plus(S1, _add_legs(core, i, M, b, received))
    M[:6, :6] = plus(M[:6, :6], inertia_matrix(S1))
    outputs = [_add_output(core, plan, options, o, M, b, received) for o in range(len(core.outputs))]
    at = 6 + np.array(forced, dtype=int)
    b[at] = minus(b[at], tau)
    return (M, b), outputs


def _add_legs(core: Core, i: int, M: Expression, b: Expression, received: GivenColumns) -> Expression:
    """Add the legs of platform i, given over [V_dot_base; delta], to M and b; return S1 as ten numbers."""
    S1, B, L, b_base, b_delta = (received.take(f"{name} {i}", size) for name, size in LEG_SUMS)
    B, L = B.reshape(6, 6), symmetric(L, 6)
    at, base = core.chain.columns_of(i + 1), range(6)
    M[:6, :6] = plus(M[:6, :6], minus(minus(L, B), B.T))
    M[np.ix_(at, base)] = minus(plus(M[np.ix_(at, base)], B.T), L)
    M[np.ix_(base, at)] = minus(plus(M[np.ix_(base, at)], B), L)
    M[np.ix_(at, at)] = plus(M[np.ix_(at, at)], L)
    b[:6] = minus(plus(b[:6], b_base), b_delta)
    b[at] = plus(b[at], b_delta)
    return S1


def _add_output(
    core: Core, plan: ModulePlan, options: Options, o: int, M: Expression, b: Expression,
    received: GivenColumns,
) -> Needed:  # fmt: skip
    """Add the inertia and bias of an output, its own or articulated, to M and b; return what it needs."""
    chain, body = core.chain, core.outputs[o]
    R0, p0, V = chain.R0[body], chain.p0[body], chain.V[body]
    own = own_inertia(plan, options.inertias[o], o)
    if options.carries[o]:
        inertia = matrix_moved(symmetric(received.take(f"I {o}", 21), 6), R0, p0)
        beta = received.take(f"beta {o}", 6)
    else:
        inertia = inertia_matrix(moved(own, R0, p0))
        beta = bias_of(own, V, options.velocity)
    J, c = motion_map(chain, body), chain.c[body]
    if options.velocity:
        c = classical(V, c)
    at_zero = np.concatenate([dot(R0, c[:3]), dot(R0, c[3:])])
    at_zero[:3] = plus(at_zero[:3], dot(hat(p0), at_zero[3:]))
    W = plus(dot(inertia, at_zero), wrench_to_base(R0, p0, beta))
    M[:] = plus(M, congruence(J, inertia))
    b[:] = plus(b, dot(J.T, W))
    return Needed(body, J, inertia, W)


def bias_of(own: Expression, V: Expression, velocity: bool) -> Expression:
    """Compute crf(V) (I V) of a body, where V is relative to an observer who moves with its origin."""
    return crf(resting(V), momentum(own, resting(V))) if velocity else zeros(6)


def write_direct(plan: ModulePlan, options: Options, *, motion: Handed | None = None) -> WrittenModule:
    """Write a module's direct model and cut it into its stages: outwards, inwards, outwards, wrists.

    With friction that grows with load, a stage before the accelerations hands on wrenches without it.

    Args:
        motion: What is held of the loops (`held_loops`), where the accelerations along the core's motions are
            given, "u_dot of core". Nothing is solved for, and the stage inwards computes how the loops open.
    """
    parts, forced = plan.parts, list[int]()
    outwards, inwards, alone, back, last = (Draft() for _ in range(5))
    answers: Handed | None = None
    options = options if motion is None else replace(options, carries=(False,) * len(options.carries))
    core, (q, v, _), (V, _) = begun(plan, options, outwards.given)
    A = back.given.base_acceleration(options)
    outwards.wanted |= _motion_outwards(core, plan, options)
    if motion is not None:
        y = _along(core, plan, motion, options, inwards, back.given)
    else:
        X, doubts = _over_base(core, plan, options)
        forced += [k for k, col in enumerate(parts.tree_v) if col in options.motors]
        form, needed = quadratic_form(core, plan, options, forced, inwards.given)
        legs = [own for _, own in read_legs(inwards.given, options.rubbing, parts, [12] * len(parts.groups))]
        pushed, guard = _pushed(core, plan, options, v, legs), core.rows.guard + squares(doubts)
        solved, inwards.wanted = _solve(core, plan, options, X, guard, form, pushed)
        y = dot(X[:, 7:], solved.u_0 - dot(solved.G, A)) + dot(X[:, :6], A) + X[:, 6]
        if options.loaded:
            model = MovedModule(core, plan, options, form, X, solved, pushed, needed, legs)
            answers = model.answers()
            inwards.wanted |= {"answers": answers.pack()} if answers.size else {}
            alone.wanted |= model.alone(alone.given)
            y = y + dot(X[:, 7:], model.changed(back.given))
    s, joints = np.concatenate([A, y]), [k for k, col in enumerate(parts.v) if col >= 0]  # Eq. (51)
    back.wanted |= accelerations_outwards(core, options, s, joints)
    wrists, guard = add_wrists(core, plan, (q, v), (V, A), s, last.given)
    last.wanted |= _of_wrists(wrists, guard if motion is None else None)
    at = {"a_core": parts.v[joints], "tau": parts.tree_v[forced]} | _at_ends(plan, wrists)
    stages = cut([outwards, inwards, *([alone] if options.loaded else []), back, last])
    return WrittenModule(stages, *read_by_core(plan), at, answers)


def _of_wrists(wrists: Mapping[int, Any], guard: Any) -> dict[str, ca.SX]:
    """Return the accelerations of wrists as an output, with their guard unless it is None."""
    out = {"a_wrists": pack([*wrists.values()])} if wrists else {}
    return out | ({"guard": ca.SX(guard)} if wrists and guard is not None else {})


def _at_ends(plan: ModulePlan, wrists: Mapping[int, Any]) -> dict[str, Index]:
    """Return the freedoms of legs and of wrists, by the name of their accelerations."""
    return {"a_legs": legs_on_paths(plan), "a_wrists": np.array([*wrists], dtype=int)}


def _over_base(core: Core, plan: ModulePlan, options: Options) -> tuple[Expression, Expression]:
    """Return y over [V_dot_base, 1, u_dot] that keeps the loops closed, and the doubts of the pivots."""
    K = core.rows.K
    with_base = _with_base(core) if options.loaded else zeros(core.chain.nv, 6)
    right = np.concatenate([minus(-K[:, :6], dot(K[:, 6:], with_base)), -core.rows.gamma[:, None]], axis=1)
    X, doubts = motions_of(plan, K[:, 6:], right)
    X[:, :6] = plus(X[:, :6], with_base)
    return X, doubts


def _with_base(core: Core) -> Expression:
    """Return the accelerations y of platforms that move as the base does, shape (n, 6).

    A leg between base and platform feels nothing of these, so that fewer numbers are not zero.
    """
    out = zeros(core.chain.nv, 6)
    for i in core.platforms:
        out[np.array(core.chain.columns_of(i + 1)) - 6] = eye(6)
    return out


def _pushed(
    core: Core, plan: ModulePlan, options: Options, v: Expression, legs: Sequence[LegAnswers]
) -> Expression:
    """Return changes of b: per unit of each bias of outputs that carry modules, then of each friction.

    Args:
        v: Rates of the spanning tree.
        legs: What legs with joints that rub tell.
    """
    out = [zeros(6 + core.chain.nv, 0)]
    for o, body in enumerate(core.outputs):
        if options.loaded and options.carries[o]:
            out.append(dot(motion_map(core.chain, body).T, wrench_map(core.chain, body)))
    return np.concatenate([*out, pushed_by(options.rubbing, core, plan, v, legs)], axis=1)


def _along(
    core: Core, plan: ModulePlan, motion: Handed, options: Options, inwards: Draft, back: GivenColumns
) -> Expression:
    """Return the core's accelerations at given motions, shape (n,).

    Args:
        inwards: The stage that computes how the loops open.
        back: Filled with what the stage after it is given.
    """
    inwards.given["held"], held = motion.again("held")
    opened = opened_loops(core, inwards.given.base_acceleration(options), held)
    inwards.wanted |= {"opened": pack(opened)} if len(opened) else {}
    back["held"], held = motion.again("held")
    u_dot, rows = back.take("u_dot of core", len(plan.motions)), back.take("opened", len(opened))
    return followed(plan, u_dot, rows, held)


def _motion_outwards(core: Core, plan: ModulePlan, options: Options) -> dict[str, ca.SX]:
    """Return the platforms' motion for the legs, and twists and biases of carrying outputs, Eq. (38)."""
    out = core.platform_columns()
    for o, body in enumerate(core.outputs):
        if not options.carries[o]:
            continue
        own, V = own_inertia(plan, options.inertias[o], o), core.chain.V[body]
        out[f"V {o}"] = pack(V[-twist_width(options.velocity) :])
        out[f"beta {o}"] = pack(bias_of(own, V, options.velocity))
        if plan.inertias is not None:
            out[f"I {o}"] = pack(upper(inertia_matrix(own)))
    return out


def _solve(
    core: Core,
    plan: ModulePlan,
    options: Options,
    X: Expression,
    guard: Any,
    form: tuple[Expression, Expression],
    pushed: Expression,
) -> tuple[Solved, dict[str, ca.SX]]:
    """Solve a module for its accelerations as functions of its base's, and of further forces.

    Args:
        X: The core's accelerations y over [V_dot_base, 1, u_dot].
        guard: Guard of its loops and their pivots.
        form: The module's quadratic form M, b.
        pushed: Columns of changes of b, shape (6 + nv, k).

    Returns:
        The solution; the guard, and the inertia and bias on a base that moves.
    """
    (M, b), Psi_b, y_0, Psi = form, X[:, :6], X[:, 6], X[:, 7:]
    M_yy, M_yb = M[6:, 6:], M[6:, :6]
    f = plus(b[6:], dot(M_yy, y_0))
    A_t = congruence(Psi, M_yy)  # Eq. (43)
    E = dot(Psi.T, plus(M_yb, dot(M_yy, Psi_b)))  # Eq. (42)
    Q_0 = -dot(Psi.T, f)  # Eq. (44) and the motors
    Q_n = -dot(Psi.T, pushed[6:])
    unforced = rest_idle(plan, options.rotor, (A_t, E, Q_0, Q_n), f)
    least, uncertain = (None, 0.0) if plan.column is None else least_inertia(plan, Psi, M_yy, A_t)
    factors, definite = factored(A_t, NEARLY_NO_INERTIA, least)
    solved = factors.solve(np.concatenate([E, Q_0[:, None]], axis=1))
    G, u_0 = solved[:, :6], solved[:, 6]
    guard = rank_guard(plan, core.rows, guard + (unforced + uncertain), Psi)
    guard = ca.SX(np.inf) if options.massless else _inertia_guard(guard, options, A_t, definite)
    out = {"guard": ca.SX(guard)}
    if options.base is None:
        inertia, bias = _on_base(form, (Psi_b, y_0), f, (E, G, u_0))
        out |= {"I_base": pack(upper(inertia)), "b_base": pack(bias)}
    return Solved(factors, G, u_0, Q_n), out


def _inertia_guard(guard: Any, options: Options, A_t: Expression, definite: Any) -> Any:
    """Return a guard that is also above 1 where the inertia A_t of a module nearly vanishes."""
    guard = ca.fmax(guard, 2.0 - ca.fmin(definite, 2.0))
    for k, usual in enumerate(options.usual):
        if usual > 0:
            guard = ca.fmax(guard, 2.0 - ca.fmin(A_t[k, k] / (NEARLY_NO_INERTIA * usual), 2.0))
    return guard


def _on_base(
    form: tuple[Expression, Expression],
    driven: tuple[Expression, Expression],
    f: Expression,
    solved: tuple[Expression, Expression, Expression],
) -> tuple[Expression, Expression]:
    """Return a module's inertia and bias on a base that moves, Eqs. (45)-(48) as congruences.

    Args:
        form: The module's quadratic form M, b.
        driven: The core's accelerations over that of the base and at rest, Psi_b and y_0.
        f: Forces on the core at the accelerations y_0.
        solved: E, G and u_0 of `_solve`.
    """
    (M, b), (Psi_b, y_0), (E, G, u_0) = form, driven, solved
    M_yy, M_yb = M[6:, 6:], M[6:, :6]
    across = dot(M_yb.T, Psi_b)
    inertia = plus(plus(M[:6, :6], plus(across, across.T)), congruence(Psi_b, M_yy))
    inertia = minus(inertia, symmetric_product(E, G))
    bias = plus(plus(plus(b[:6], dot(M_yb.T, y_0)), dot(Psi_b.T, f)), dot(E.T, u_0))
    return inertia, bias
