"""Write the direct model of one module: Eqs. (38)-(53) in the form of `hybridyn.dynamics.direct_recursion`.

One graph is cut into four stages: outwards (motion), inwards (articulated inertia), outwards (accelerations),
wrists. The module's quadratic form over s = [V_dot_base; y] is M, b. Its closures give y = Psi u_dot + Psi_b
V_dot_base + y_0, and u_dot = A_t^-1 (Q_0 - E V_dot_base).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

from ...dynamics.guards import FORCED
from ...spatial import Array, Index
from .chains import forces, mass_matrix, motion_map, sweep
from .core import (
    Core,
    Plan,
    core_body,
    motions_of,
    own_inertia,
    rank_guard,
    whole,
    wrist_accelerations,
    write_core,
)
from .expressions import (
    Expression,
    along,
    congruence,
    dot,
    hat,
    numbers,
    pack,
    symbols,
    symmetric,
    upper,
    zeros,
)
from .guards import size_of, trusted, weighed
from .legs import PlatformMotion, leg_accelerations, leg_sums, write_leg
from .request import DirectOptions, InverseOptions, ModuleOptions
from .rigid import classical, crf, inertia_matrix, matrix_moved, momentum, moved, resting, to_child, to_parent
from .stages import (
    BaseMotion,
    Stage,
    WrittenModule,
    base_motion,
    cut,
    parameters_of,
    read_by_core,
    scattered,
    twist_width,
)
from .static_elimination import solve_definite

#: Contributions of the legs of a platform (`legs.leg_sums`), and the size of each.
LEG_SUMS = (("S1", 10), ("B", 36), ("L", 21), ("b_base", 6), ("b_delta", 6))


def quadratic_form(
    core: Core, plan: Plan, options: DirectOptions, forced: list[int], received: dict[str, ca.SX]
) -> tuple[Expression, Expression]:
    """Compute M, shape (6 + nv, 6 + nv), and b, shape (6 + nv,).

    Args:
        options: Options of the direct model.
        forced: Freedoms of the core on which an effort acts.
        received: Filled with the columns of symbols that other kernels provide, by name.
    """
    chain, parts = core.chain, plan.parts
    tau_column, tau = symbols("tau", len(forced))
    received |= {"tau": tau_column} if forced else {}
    M, S1 = mass_matrix(chain)
    b = forces(chain) if options.velocity else zeros(6 + chain.nv)
    for k, col in enumerate(parts.tree_v):
        M[6 + k, 6 + k] = M[6 + k, 6 + k] + options.rotor[col]
    for i in sorted({group[0].platform for group in parts.groups}):
        S1 = S1 + _add_legs(core, i, M, b, received)
    M[:6, :6] = M[:6, :6] + inertia_matrix(S1)
    for o in range(len(core.outputs)):
        _add_output(core, plan, options, o, M, b, received)
    at = 6 + np.array(forced, dtype=int)
    b[at] = b[at] - tau
    return M, b


def _add_legs(core: Core, i: int, M: Expression, b: Expression, received: dict[str, ca.SX]) -> Expression:
    """Add the legs of platform i, given over [V_dot_base; delta], to M and b; return S1 as ten numbers."""
    columns = {name: symbols(f"{name} {i}", size) for name, size in LEG_SUMS}
    received |= {f"{name} {i}": column for name, (column, _) in columns.items()}
    S1, B, L, b_base, b_delta = (entries for _, entries in columns.values())
    B, L = B.reshape(6, 6), symmetric(L, 6)
    at, base = core.chain.columns_of(i + 1), range(6)
    M[:6, :6] = M[:6, :6] + (L - B - B.T)
    M[np.ix_(at, base)] = M[np.ix_(at, base)] + B.T - L
    M[np.ix_(base, at)] = M[np.ix_(base, at)] + B - L
    M[np.ix_(at, at)] = M[np.ix_(at, at)] + L
    b[:6] = b[:6] + b_base - b_delta
    b[at] = b[at] + b_delta
    return S1


def _add_output(
    core: Core, plan: Plan, options: DirectOptions, o: int, M: Expression, b: Expression,
    received: dict[str, ca.SX],
) -> None:  # fmt: skip
    """Add the inertia and bias of an output, its own or articulated, to M and b."""
    chain, body = core.chain, core.outputs[o]
    R0, p0, V = chain.R0[body], chain.p0[body], chain.V[body]
    own = own_inertia(plan, options.inertias[o], o)
    if options.carries[o]:
        received[f"I {o}"], entries = symbols(f"I {o}", 21)
        received[f"beta {o}"], beta = symbols(f"beta {o}", 6)
        inertia = matrix_moved(symmetric(entries, 6), R0, p0)
    else:
        inertia = inertia_matrix(moved(own, R0, p0))
        beta = bias_of(own, V, options.velocity)
    J, c = motion_map(chain, body), chain.c[body]
    if options.velocity:
        c = classical(V, c)
    at_zero = np.concatenate([dot(R0, c[:3]), dot(R0, c[3:])])
    at_zero[:3] = at_zero[:3] + dot(hat(p0), at_zero[3:])
    M[:] = M + congruence(J, inertia)
    b[:] = b + dot(J.T, dot(inertia, at_zero) + to_parent(R0, p0, beta))


def bias_of(own: Expression, V: Expression, velocity: bool) -> Expression:
    """Compute crf(V) (I V) of a body, where V is relative to an observer who moves with its origin."""
    return crf(resting(V), momentum(own, resting(V))) if velocity else zeros(6)


#: Ratio of an inertia to what it is the difference of, below which accelerations lose more than five digits:
#: of a pivot to its diagonal entry, and of this to the inertia with all other joints locked (of the first
#: axis of a gimbal-locked wrist of light links).
NEARLY_NO_INERTIA = 1e-5


@dataclass(frozen=True, eq=False)
class DirectModule(WrittenModule):
    """Stages of one module's direct model: outwards, inwards, outwards, wrists.

    Attributes:
        joints: Freedoms of the spanning tree in the output "a_core".
        wrists: Freedoms of the spanning tree in the output "a_wrists".
        legs: Freedoms of the spanning tree in the input "a_legs".
        tau: Freedoms of the tree after the cuts in the input "tau".
    """

    joints: Index
    wrists: Index
    legs: Index
    tau: Index


@dataclass(frozen=True)
class _Solved:
    """Solution of one module: y = Psi u_dot + Psi_b V_dot_base + y_0 and u_dot = u_0 - G V_dot_base.

    Attributes:
        Psi, Psi_b, y_0: Accelerations that keep the core's loops closed.
        E, G: Eq. (42), and A_t^-1 E.
        f: Generalised force along y that y_0 and the bias require.
        u_0: A_t^-1 Q_0.
        guard: Largest guard of all pivots.
    """

    Psi: Expression
    Psi_b: Expression
    y_0: Expression
    E: Expression
    G: Expression
    f: Expression
    u_0: Expression
    guard: Any

    def u_dot(self, A_base: Expression) -> Expression:
        """Compute the accelerations along the module's motions from the base's, Eq. (51)."""
        return self.u_0 - dot(self.G, A_base)

    def y(self, A_base: Expression) -> Expression:
        """Compute the core's accelerations from the base's, Eq. (51)."""
        return dot(self.Psi, self.u_dot(A_base)) + dot(self.Psi_b, A_base) + self.y_0


def write_direct(plan: Plan, options: DirectOptions) -> DirectModule:
    """Write a module's direct model and cut it into its stages."""
    parts, spanning = plan.parts, plan.mechanism.spanning
    at_q, at_v = read_by_core(plan)
    (q_column, q), (v_column, v) = scattered("q", at_q, spanning.nq), scattered("v", at_v, spanning.nv)
    base = base_motion(options.base, options.velocity)
    core = write_core(plan, q, v, base.V)
    inputs = [{"q": q_column, "v": v_column} | parameters_of(plan) | base.V_column, {}, base.A_column, {}]
    outputs = [_motion_outwards(core, plan, options), {}, {}, {}]
    # Inwards.
    forced = [k for k, col in enumerate(parts.tree_v) if col in options.motors]
    M, b = quadratic_form(core, plan, options, forced, inputs[1])
    solved = _solve(core, plan, options, M, b)
    outputs[1]["guard"] = ca.SX(solved.guard)
    if options.base is None:
        outputs[1] |= _onto_base(solved, M, b)
    # Outwards.
    s = np.concatenate([base.A, solved.y(base.A)])
    joints = [k for k, col in enumerate(parts.v) if col >= 0]
    outputs[2] |= _accelerations_outwards(core, options, s, joints)
    # Wrists.
    legs = _legs_on_paths(plan)
    wrists, guard = _add_wrists(core, plan, (q, v), base, s, inputs[3])
    outputs[3] |= {"a_wrists": pack(list(wrists.values())), "guard": ca.SX(guard)} if wrists else {}
    return DirectModule(
        cut(inputs, outputs), at_q, at_v, tuple(sorted(core.platforms)),
        parts.v[joints], np.array(list(wrists), dtype=int), legs, parts.tree_v[forced],
    )  # fmt: skip


def write_motion(plan: Plan, options: ModuleOptions) -> DirectModule:
    """Write the accelerations of a module's joints from those along its motions, "u_dot".

    The stages are those of `write_direct` without its second one, with the same names.
    """
    parts, spanning = plan.parts, plan.mechanism.spanning
    at_q, at_v = read_by_core(plan)
    (q_column, q), (v_column, v) = scattered("q", at_q, spanning.nq), scattered("v", at_v, spanning.nv)
    base = base_motion(options.base, options.velocity)
    core = write_core(plan, q, v, base.V)
    X, _ = _closed(core, plan)
    column, u_dot = symbols("u_dot", X.shape[1] - 7)
    s = np.concatenate([base.A, dot(X[:, 7:], u_dot) + dot(X[:, :6], base.A) + X[:, 6]])
    joints = [k for k, col in enumerate(parts.v) if col >= 0]
    inputs = [
        {"q": q_column, "v": v_column} | parameters_of(plan) | base.V_column,
        base.A_column | {"u_dot": column},
        {},
    ]
    still = replace(options, carries=(False,) * len(options.carries))
    outputs = [_motion_outwards(core, plan, still), _accelerations_outwards(core, still, s, joints), {}]
    wrists, _ = _add_wrists(core, plan, (q, v), base, s, inputs[2])
    outputs[2] |= {"a_wrists": pack(list(wrists.values()))} if wrists else {}
    return DirectModule(
        cut(inputs, outputs), at_q, at_v, tuple(sorted(core.platforms)),
        parts.v[joints], np.array(list(wrists), dtype=int), _legs_on_paths(plan), parts.tree_v[:0],
    )  # fmt: skip


def _motion_outwards(core: Core, plan: Plan, options: ModuleOptions) -> dict[str, ca.SX]:
    """Return the platforms' motion for the legs, and twists and biases of carrying outputs, Eq. (38)."""
    out: dict[str, ca.SX] = {}
    for i, motion in sorted(core.platforms.items()):
        out[f"platform {i}"] = motion.column()
    for o, body in enumerate(core.outputs):
        if not options.carries[o]:
            continue
        own, V = own_inertia(plan, options.inertias[o], o), core.chain.V[body]
        out[f"V {o}"] = pack(V[-twist_width(options.velocity) :])
        out[f"beta {o}"] = pack(bias_of(own, V, options.velocity))
        if plan.inertias is not None:
            out[f"I {o}"] = pack(upper(inertia_matrix(own)))
    return out


def _solve(core: Core, plan: Plan, options: DirectOptions, M: Expression, b: Expression) -> _Solved:
    """Solve a module for y as a function of its base's acceleration."""
    X, trust = _closed(core, plan)
    Psi_b, y_0, Psi = X[:, :6], X[:, 6], X[:, 7:]
    M_yy, M_yb = M[6:, 6:], M[6:, :6]
    f = b[6:] + dot(M_yy, y_0)
    A_t = congruence(Psi, M_yy)  # Eq. (43)
    E = dot(Psi.T, M_yb + dot(M_yy, Psi_b))  # Eq. (42)
    Q_0 = -dot(Psi.T, f)  # Eq. (44) and the motors
    unforced = _hold_thin(plan, options, (A_t, E, Q_0), f)
    solved, definite = solve_definite(A_t, np.concatenate([E, Q_0[:, None]], axis=1), NEARLY_NO_INERTIA)
    guard = rank_guard(plan, core.rows, core.rows.guard + trusted(trust) + unforced, Psi)
    guard = ca.SX(np.inf) if options.massless else ca.fmax(guard, 2.0 - ca.fmin(definite, 2.0))
    for k, usual in enumerate(options.usual):
        if usual > 0:
            guard = ca.fmax(guard, 2.0 - ca.fmin(A_t[k, k] / (NEARLY_NO_INERTIA * usual), 2.0))
    return _Solved(Psi, Psi_b, y_0, E, solved[:, :6], f, solved[:, 6], guard)


def _hold_thin(
    plan: Plan, options: DirectOptions, equation: tuple[Expression, Expression, Expression], f: Expression
) -> Any:
    """Give spins without inertia no acceleration, the least; return the guard of the forces on them.

    Args:
        equation: A_t, E and Q_0 of the module, changed in place.
        f: The forces along y, of whose terms those on the spins may be rounding.
    """
    A_t, E, Q_0 = equation
    thin = list(options.thin)
    if not thin:
        return 0.0
    size = size_of(f, 1.0 / plan.mechanism.reduction.col_scale[plan.parts.tree_v], [], 1.0)
    limits = replace(plan.scale, closed=min(plan.scale.closed, FORCED))
    guard = weighed([(Q_0[thin], 1.0)], limits.weight(size))
    E[thin], Q_0[thin], A_t[thin], A_t[:, thin] = 0.0, 0.0, 0.0, 0.0
    A_t[thin, thin] = 1.0
    return guard


def _closed(core: Core, plan: Plan) -> tuple[Expression, Any]:
    """Solve the core's closures for y over [V_dot_base, 1, u_dot]; return also the pivots' trust."""
    right = np.concatenate([-core.rows.K[:, :6], -core.rows.gamma[:, None]], axis=1)
    return motions_of(plan, core.rows.K[:, 6:], right)


def _onto_base(x: _Solved, M: Expression, b: Expression) -> dict[str, ca.SX]:
    """Compute a module's contribution to its base's inertia and bias, Eqs. (45)-(48) as congruences."""
    M_yb = M[6:, :6]
    across = dot(M_yb.T, x.Psi_b)
    inertia = M[:6, :6] + (across + across.T) + congruence(x.Psi_b, M[6:, 6:]) - _product(x.E, x.G)
    bias = b[:6] + dot(M_yb.T, x.y_0) + dot(x.Psi_b.T, x.f) + dot(x.E.T, x.u_0)
    return {"I_base": pack(upper(inertia)), "b_base": pack(bias)}


def _accelerations_outwards(
    core: Core, options: ModuleOptions, s: Expression, joints: list[int]
) -> dict[str, ca.SX]:
    """Return accelerations of the core's joints, of platforms less the base's, and of outputs, Eq. (53)."""
    out: dict[str, ca.SX] = {}
    if joints:
        out["a_core"] = pack(s[6:][joints])
    for i in sorted(core.platforms):
        out[f"delta {i}"] = pack(s[core.chain.columns_of(i + 1)] - s[:6])
    for o, body in enumerate(core.outputs):
        if options.carries[o]:
            A = whole(core.chain, body, s, motion_map(core.chain, body))
            out[f"A {o}"] = pack(classical(core.chain.V[body], A) if options.velocity else A)
    return out


def _product(E: Expression, G: Expression) -> Expression:
    """Compute E^T G, which is symmetric, from one triangle."""
    out = zeros(6, 6)
    for i in range(6):
        for j in range(i, 6):
            out[i, j] = out[j, i] = along(E[:, i], G[:, j]) if len(E) else 0.0
    return out


def _legs_on_paths(plan: Plan) -> Index:
    """Return the freedoms of grouped legs on paths to wrists."""
    own = {int(col) for col in plan.parts.v if col >= 0}
    wrists = {int(col) for path in plan.paths for col in path.v[path.wrist_v]}
    return np.array(sorted({int(c) for path in plan.paths for c in path.v} - own - wrists), dtype=int)


def _add_wrists(
    core: Core, plan: Plan, given: tuple[Expression, Expression], base: BaseMotion, s: Expression,
    received: dict[str, ca.SX],
) -> tuple[dict[int, Any], Any]:  # fmt: skip
    """Compute the wrists' accelerations by freedom of the spanning tree, and the guard of their pivots.

    Given are q and v of the spanning tree and s = [V_dot_base; y]. `received` gets the legs' accelerations.
    """
    (q, v), parts, legs = given, plan.parts, _legs_on_paths(plan)
    column, a_legs = symbols("a_legs", len(legs))
    received |= {"a_legs": column} if len(legs) else {}
    known = dict(zip(legs.tolist(), a_legs, strict=True))
    known |= {int(col): s[6 + k] for k, col in enumerate(parts.v) if col >= 0}
    out: dict[int, Any] = {}
    guard: Any = ca.SX(0.0)
    for path, pivots in zip(plan.paths, plan.wrist_pivots, strict=True):
        a = np.array([(known | out).get(int(col), 0.0) for col in path.v], dtype=object)
        a[path.wrist_v] = 0.0
        chain = sweep(list(path.links), q[path.q], v[path.v], base.V, a, base.A)
        body = core_body(plan, path.wrist.target)
        target = whole(core.chain, body, s, motion_map(core.chain, body))
        target = to_child(numbers(path.wrist.R), numbers(path.wrist.p), target)
        solved, trust = wrist_accelerations(path, chain, target, pivots)
        out |= {int(col): value for col, value in zip(path.v[path.wrist_v], solved, strict=True)}
        guard = ca.fmax(guard, trusted(trust))
    return out, guard


def write_direct_legs(
    plan: Plan, n: int, options: DirectOptions | InverseOptions, *, motion: bool = False
) -> tuple[list[Stage], Array]:
    """Write the direct model of group n of a module, and return its stages and its legs' own numbers.

    Args:
        motion: Whether one stage computes the accelerations "a" alone.
    """
    group = plan.parts.groups[n]
    leg, forced = group[0], group[0].among(options.motors)
    (q_column, q), (v_column, v) = symbols("q", len(leg.q)), symbols("v", len(leg.v))
    base = base_motion(options.base, options.velocity)
    p_column, platform = PlatformMotion.symbols(accelerations=False)
    tau_column, efforts = symbols("tau", len(forced))
    delta_column, delta = symbols("delta", 6)
    tau = zeros(len(leg.v))
    tau[forced] = efforts
    written = write_leg(group, q, v, (base.V, base.A), platform, plan.scale, plan.leg_pivots[n])
    rotor = written.folding.array([np.array([options.rotor[c] for c in leg.tree_v]) for leg in group])
    sums = leg_sums(written, tau, options.velocity, rotor)
    inputs = {"numbers": written.folding.symbol(), "q": q_column, "v": v_column, "platform": p_column}
    inputs |= base.V_column | ({"tau": tau_column} if forced else {})
    outputs = {name: pack(sums[name]) for name, _ in LEG_SUMS} | {"guard": ca.SX(written.guard)}
    later, follows = {"delta": delta_column}, {"a": pack(leg_accelerations(written, delta))}
    given, wanted = ([inputs | later], [follows]) if motion else ([inputs, later], [outputs, follows])
    return cut(given, wanted), written.folding.table(len(group))
