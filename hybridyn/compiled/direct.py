"""The direct model of one module, written: Eqs. (38)-(53) in the form of `hybridyn.articulation`.

One graph, cut into four stages: outwards (motion), inwards (articulated inertia), outwards (accelerations),
wrists. Over s = [V_dot_base; y] the module's quadratic form is M, b; its closures give y = Psi u + Psi_b
V_dot_base + y_0; and u_dot = A_t^-1 (Q_0 - E V_dot_base).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from ..spatial import Index
from .chains import forces, mass_matrix, motion_map, sweep
from .core import Core, Plan, core_body, own_inertia, write_core
from .expressions import Expression, congruence, dot, hat, pack, plain, symbols, symmetric, upper, zeros
from .guards import trusted
from .paths import wrist_accelerations
from .rigid import (
    classical,
    crf,
    inertia_matrix,
    matrix_moved,
    momentum,
    moved,
    resting,
    to_child,
    to_parent,
)
from .staging import Stage, cut
from .static_elimination import solve, solve_definite

#: A pivot of an inertia below this part of its diagonal entry: a motion that is all but without inertia.
WITHOUT_INERTIA = 1e-9
#: The same for a diagonal entry, of what is moved with all joints locked: an articulated inertia is a
#: difference, and may be rounding alone (the first axis of a gimbal-locked wrist of light links).
OF_LOCKED = 1e-5


@dataclass(frozen=True)
class DirectOptions:
    """What the code of a module depends on beside the module.

    Attributes:
        base: The base's acceleration (less gravity) where it is a constant and the base rests, else None.
        carries: For each output whether another module stands on it.
        inertias: For each output its own ten numbers with those that its modules' legs hand to it.
        velocity: Whether velocity terms are on.
        rotor: Rotor inertias over the freedoms of the tree after the cuts, as a tuple.
        motors: Freedoms of the tree after the cuts that have an effort.
        usual: For each freedom of a module without loops that carries others what it moves at most, all
            joints behind it locked, without units of its own; else nothing.
    """

    base: tuple[float, ...] | None
    carries: tuple[bool, ...]
    inertias: tuple[tuple[float, ...], ...]
    velocity: bool
    rotor: tuple[float, ...]
    motors: tuple[int, ...]
    usual: tuple[float, ...]


@dataclass(frozen=True)
class DirectModule:
    """The stages of one module's direct model, and which entries of q, v, a they read and write.

    Attributes:
        stages: Outwards, inwards, outwards, wrists.
        q, v: Coordinates of the spanning tree that the inputs "q", "v" hold.
        joints: Freedoms of the spanning tree that the output "a_core" holds.
        wrists: Those that "a_wrists" holds.
        legs: Those that the input "a_legs" holds.
        tau: Freedoms of the tree after the cuts that the input "tau" holds.
        platforms: Links of the core that are platforms, in the order of the outputs "platform i".
    """

    stages: list[Stage]
    q: Index
    v: Index
    joints: Index
    wrists: Index
    legs: Index
    tau: Index
    platforms: tuple[int, ...]


def write_direct(name: str, plan: Plan, options: DirectOptions) -> DirectModule:
    """Write a module's direct model and cut it into its stages."""
    parts, m = plan.parts, plan.mechanism
    at_q, at_v = read_by_core(plan)
    (q_col, q), (v_col, v) = scattered("q", at_q, m.spanning.nq), scattered("v", at_v, m.spanning.nv)
    fixed = options.base is not None
    V_col, V_base = base_twist(options.velocity)
    A_col, A_base = symbols("A_base", 6)
    if fixed:
        V_base, A_base = zeros(6), plain(options.base)
    core = write_core(plan, q, v, V_base)
    inputs: list[dict[str, ca.SX]] = [{"q": q_col, "v": v_col} | parameters_of(plan), {}, {}, {}]
    outputs: list[dict[str, ca.SX]] = [{}, {}, {}, {}]
    if not fixed:
        inputs[0]["V_base"], inputs[2]["A_base"] = V_col, A_col

    # Outwards: platforms for the legs, twists and biases of the outputs.
    order = tuple(sorted(core.platforms))
    for i in order:
        motion = core.platforms[i]
        outputs[0][f"platform {i}"] = pack(motion.R, motion.p, motion.V)
    for o, body in enumerate(core.outputs):
        own, V = own_inertia(plan, options.inertias[o], o), core.chain.V[body]
        bias = crf(resting(V), momentum(own, resting(V))) if options.velocity else zeros(6)
        if options.carries[o]:
            outputs[0][f"V {o}"], outputs[0][f"bias {o}"] = pack(V[-V_col.numel() :]), pack(bias)
            if parts.own is not None:
                outputs[0][f"own {o}"] = pack(upper(inertia_matrix(own)))

    # Inwards.
    mine = [k for k, col in enumerate(parts.tree_v) if col in options.motors]
    tau_col, tau = symbols("tau", len(mine))
    if mine:
        inputs[1]["tau"] = tau_col
    M, b = _quadratic_form(core, plan, options, inputs[1])
    b[6 + np.array(mine, dtype=int)] = b[6 + np.array(mine, dtype=int)] - tau
    K_y, right = core.rows.K[:, 6:], np.concatenate([-core.rows.K[:, :6], -core.rows.gamma[:, None]], axis=1)
    X, trust = solve(K_y, right, plan.loop_pivots)
    Psi_b, y_0, Psi = X[:, :6], X[:, 6], X[:, 7:]
    M_yy, M_yb, f = M[6:, 6:], M[6:, :6], b[6:] + dot(M[6:, 6:], y_0)
    A_t = congruence(Psi, M_yy)
    E = dot(Psi.T, M_yb + dot(M_yy, Psi_b))
    Q_0 = -dot(Psi.T, f)
    solved, definite = solve_definite(A_t, np.concatenate([E, Q_0[:, None]], axis=1), WITHOUT_INERTIA)
    G, y = solved[:, :6], solved[:, 6]
    guard = ca.fmax(core.rows.guard, trusted(trust))
    guard = ca.fmax(guard, 2.0 - ca.fmin(definite, 2.0))
    for k, usual in enumerate(options.usual):
        if usual > 0:
            guard = ca.fmax(guard, 2.0 - ca.fmin(A_t[k, k] / (OF_LOCKED * usual), 2.0))
    outputs[1]["guard"] = ca.SX(guard)
    if not fixed:
        onto = M[:6, :6] + _added(dot(M_yb.T, Psi_b)) + congruence(Psi_b, M_yy) - _product(E, G)
        bias = b[:6] + dot(M_yb.T, y_0) + dot(Psi_b.T, f) + dot(E.T, y)
        outputs[1]["I_base"], outputs[1]["b_base"] = pack(upper(onto)), pack(bias)

    # Outwards.
    s_y = dot(Psi, y - dot(G, A_base)) + dot(Psi_b, A_base) + y_0
    s = np.concatenate([A_base, s_y])
    joints = [k for k, col in enumerate(parts.v) if col >= 0]
    if joints:
        outputs[2]["a_core"] = pack(s_y[joints])
    at = core.chain.columns_of
    for i in order:
        outputs[2][f"delta {i}"] = pack(s[at(i + 1)] - A_base)
    for o, body in enumerate(core.outputs):
        if options.carries[o]:
            A = _whole(core, body, s)
            outputs[2][f"A {o}"] = pack(classical(core.chain.V[body], A) if options.velocity else A)

    # Wrists.
    legs = _legs_on_paths(plan)
    a_col, a_legs = symbols("a_legs", len(legs))
    if len(legs):
        inputs[3]["a_legs"] = a_col
    known: dict[int, Any] = dict(zip(legs.tolist(), a_legs, strict=True))
    known |= {int(parts.v[k]): s_y[k] for k in joints}
    wrists, guard = _wrists(core, plan, q, v, known, s, A_base, V_base)
    if wrists:
        outputs[3]["a_wrists"] = pack([known[col] for col in wrists])
        outputs[3]["guard"] = ca.SX(guard)
    stages = cut(name, inputs, outputs)
    return DirectModule(
        stages, at_q, at_v, parts.v[joints], np.array(wrists, dtype=int), legs, parts.tree_v[mine], order
    )


def base_twist(velocity: bool) -> tuple[ca.SX, Expression]:
    """Give symbols for the twist of a module's base, and the twist.

    Every module is written as an observer sees it who moves with its base's origin, so that only the base's
    rotation counts, and no digit is spent on a velocity that all share. Without velocity terms the model is
    not the same for all observers, and the whole twist is taken.
    """
    width = 3 if velocity else 6
    column, entries = symbols("V_base", width)
    return column, np.concatenate([zeros(6 - width), entries])


def read_by_core(plan: Plan) -> tuple[Index, Index]:
    """Give the coordinates and freedoms of the spanning tree that a core reads."""
    parts = plan.parts
    out = []
    for own, paths in ((parts.q, [p.q for p in plan.paths]), (parts.v, [p.v for p in plan.paths])):
        out.append(np.unique(np.concatenate([own[own >= 0], *paths]).astype(int)))
    return out[0], out[1]


def parameters_of(plan: Plan) -> dict[str, ca.SX]:
    """Give the inertial parameters of a module's bodies where they are inputs."""
    own = plan.parts.own
    return {} if own is None else {"parameters": ca.vertcat(*[x for numbers in own for x in numbers])}


def scattered(name: str, index: Index, width: int) -> tuple[ca.SX, Expression]:
    """Give symbols for some entries of a vector, and the vector with zeros elsewhere."""
    column, entries = symbols(name, len(index))
    out = zeros(width)
    out[index] = entries
    return column, out


def _quadratic_form(
    core: Core, plan: Plan, options: DirectOptions, inputs: dict[str, ca.SX]
) -> tuple[Expression, Expression]:
    """Give M and b over s of legs and outputs; what comes from elsewhere becomes inputs."""
    chain, parts = core.chain, plan.parts
    M, S1 = mass_matrix(chain)
    b = forces(chain) if options.velocity else zeros(6 + chain.nv)
    base = slice(0, 6)
    for k, col in enumerate(parts.tree_v):
        M[6 + k, 6 + k] = M[6 + k, 6 + k] + options.rotor[col]
    for i in sorted({group[0].platform for group in parts.groups}):
        columns = {
            n: symbols(f"{n} {i}", w)
            for n, w in (("S1", 10), ("B", 36), ("L", 21), ("b_base", 6), ("b_delta", 6))
        }
        inputs |= {f"{n} {i}": column for n, (column, _) in columns.items()}
        B, L = columns["B"][1].reshape(6, 6), symmetric(columns["L"][1], 6)
        b_base, b_delta = columns["b_base"][1], columns["b_delta"][1]
        at = chain.columns_of(i + 1)
        S1 = S1 + columns["S1"][1]
        M[base, base] = M[base, base] + (L - B - B.T)
        M[np.ix_(at, range(6))] = M[np.ix_(at, range(6))] + B.T - L
        M[np.ix_(range(6), at)] = M[np.ix_(range(6), at)] + B - L
        M[np.ix_(at, at)] = M[np.ix_(at, at)] + L
        b[base] = b[base] + b_base - b_delta
        b[at] = b[at] + b_delta
    M[base, base] = M[base, base] + inertia_matrix(S1)
    for o, body in enumerate(core.outputs):
        _add_output(core, plan, options, o, body, M, b, inputs)
    return M, b


def _add_output(
    core: Core,
    plan: Plan,
    options: DirectOptions,
    o: int,
    body: int,
    M: Expression,
    b: Expression,
    inputs: dict[str, ca.SX],
) -> None:
    """Add an output's inertia and bias, its own or articulated, to M and b."""
    chain = core.chain
    R0, p0, V = chain.R0[body], chain.p0[body], chain.V[body]
    own = own_inertia(plan, options.inertias[o], o)
    if options.carries[o]:
        inputs[f"I {o}"], entries = symbols(f"I {o}", 21)
        inputs[f"beta {o}"], beta = symbols(f"beta {o}", 6)
        inertia = matrix_moved(symmetric(entries, 6), R0, p0)
    else:
        inertia = inertia_matrix(moved(own, R0, p0))
        beta = crf(resting(V), momentum(own, resting(V))) if options.velocity else zeros(6)
    J, c = motion_map(chain, body), chain.c[body]
    if options.velocity:
        c = classical(V, c)
    at_zero = np.concatenate([dot(R0, c[:3]), dot(R0, c[3:])])
    at_zero[:3] = at_zero[:3] + dot(hat(p0), at_zero[3:])
    M[:] = M + congruence(J, inertia)
    b[:] = b + dot(J.T, dot(inertia, at_zero) + to_parent(R0, p0, beta))


def _added(X: Expression) -> Expression:
    """Give X + X^T."""
    return X + X.T


def _product(E: Expression, G: Expression) -> Expression:
    """Give E^T G, which is symmetric; one triangle is computed."""
    out = zeros(6, 6)
    for i in range(6):
        for j in range(i, 6):
            out[i, j] = out[j, i] = dot(E[:, i], G[:, j][:, None])[0] if len(E) else 0.0
    return out


def _whole(core: Core, body: int, s: Expression) -> Expression:
    """Give a body's acceleration, own frame."""
    chain = core.chain
    return to_child(chain.R0[body], chain.p0[body], dot(motion_map(chain, body), s)) + chain.c[body]


def _legs_on_paths(plan: Plan) -> Index:
    """Give the freedoms of legs of groups that lie on paths to wrists."""
    own = {int(col) for col in plan.parts.v if col >= 0}
    wrists = {int(col) for path in plan.paths for col in path.v[path.wrist_v]}
    return np.array(sorted({int(c) for path in plan.paths for c in path.v} - own - wrists), dtype=int)


def _wrists(
    core: Core, plan: Plan, q: Expression, v: Expression, known: dict[int, Any], s: Expression,
    A_base: Expression, V_base: Expression,
) -> tuple[list[int], Any]:  # fmt: skip
    """Give the accelerations of all wrists, entered in `known`, and the guard of their pivots."""
    cols: list[int] = []
    guard: Any = ca.SX(0.0)
    for path, pivots in zip(plan.paths, plan.wrist_pivots, strict=True):
        a = np.array([known.get(int(col), 0.0) for col in path.v], dtype=object)
        own = path.v[path.wrist_v]
        a[path.wrist_v] = 0.0
        chain = sweep(list(path.links), q[path.q], v[path.v], V_base, a, A_base)
        target = _whole(core, core_body(plan, path.wrist.target), s)
        target = to_child(plain(path.wrist.R), plain(path.wrist.p), target)
        solved, trust = wrist_accelerations(path, chain, target, pivots)
        known |= {int(col): value for col, value in zip(own, solved, strict=True)}
        cols += own.tolist()
        guard = ca.fmax(guard, trusted(trust))
    return cols, guard
