"""Write the inverse model of one module: Eqs. (30)-(33) in the form of `hybridyn.idm`.

It has two stages: outwards (motion and the forces of the core) and inwards (motor efforts and the base's
wrench).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from ...spatial import Array, Index
from .actuation import motor_efforts
from .chains import Chain, Placed, forces, motion_map, sweep
from .core import Core, Plan, motions_of, own_inertia, rank_guard, write_core
from .expressions import Expression, along, cross, dot, pack, symbols, zeros
from .guards import trusted
from .legs import PlatformMotion, WrittenLeg, write_leg
from .request import InverseOptions
from .rigid import classical, crf, momentum, resting, to_child, to_parent
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
from .static_elimination import Pivots


@dataclass(frozen=True, eq=False)
class InverseModule(WrittenModule):
    """Stages of one module's inverse model: outwards, inwards.

    Attributes:
        laws: Freedoms of the tree after the cuts in the input "laws".
    """

    laws: Index


@dataclass
class _RequiredForces:
    """Sum of the generalised forces that a motion requires.

    Attributes:
        b: The sum over s = [base; y], shape (6 + n,).
        terms: The terms of the sum that one module can distinguish, as work per scaled coordinate.
        length: The module's length [m].
        received: Columns of symbols that other kernels provide, by name.
    """

    b: Expression
    terms: list[Any]
    length: float
    received: dict[str, ca.SX]

    def count(self, wrench: Expression) -> None:
        """Append a wrench to the terms."""
        self.terms += [*(wrench[:3] * self.length), *wrench[3:]]

    def receive(self, name: str) -> Expression:
        """Return the symbols of a wrench that another kernel provides, shape (6,)."""
        self.received[name], wrench = symbols(name, 6)
        return wrench

    def size(self) -> Any:
        """Compute the sum of the terms' absolute values."""
        size = ca.SX(0.0)
        for value in self.terms:
            size = size + ca.fabs(value)
        return size


def write_inverse(
    plan: Plan,
    options: InverseOptions,
    pivots: Pivots | None,
    *,
    balance: bool = False,
    motions: bool = False,
) -> InverseModule:
    """Write a module's inverse model and cut it into its stages.

    Args:
        options: Options of the inverse model.
        pivots: Pivots of the motor map.
        balance: Whether the output is "Q" = Psi^T b, what is left of the forces along the module's motions,
            instead of the motor efforts "tau". Motor efforts are then among the laws. Along a thin spin, what
            is left is its acceleration, which the direct model makes zero.
        motions: Whether the first stage has the output "u_dot", the accelerations along its motions.
    """
    parts, spanning = plan.parts, plan.mechanism.spanning
    at_q, at_v = read_by_core(plan)
    q_column, q = scattered("q", at_q, spanning.nq)
    (v_column, v), (a_column, a) = (scattered(x, at_v, spanning.nv) for x in ("v", "a"))
    base = base_motion(options.base, options.velocity)
    motion = {"q": q_column, "v": v_column, "a": a_column} | parameters_of(plan)
    core = write_core(plan, q, v, base.V, a, base.A)
    needed = _required_forces(
        core, plan, options, core.chain if options.velocity else _without_rates(core, plan, q, a, base), a
    )
    laws = [k for k, col in enumerate(parts.tree_v) if int(col) in options.laws]
    laws_column, law = symbols("laws", len(laws))
    needed.received |= {"laws": laws_column} if laws else {}
    at = 6 + np.array(laws, dtype=int)
    needed.b[at] = needed.b[at] - law
    X, trust = motions_of(plan, core.rows.K[:, 6:], zeros(len(core.rows.K), 1))
    guard = rank_guard(plan, core.rows, core.rows.guard + trusted(trust), X[:, 1:])
    if balance:
        left = dot(X[:, 1:].T, needed.b[6:])
        left[list(options.thin)] = _along_motions(core, plan, a)[list(options.thin)]
        efforts = {"guard": ca.SX(guard), "Q": pack(left)}
    else:
        tau, measure = _efforts(core, plan, options, X[:, 1 + len(parts.spins) :], needed, pivots)
        efforts = {"guard": ca.SX(guard + measure)} | ({"tau": pack(tau)} if len(tau) else {})
    if options.base is None:
        efforts["F_base"] = pack(_base_wrench(core, needed.b))
    along = {"u_dot": pack(_along_motions(core, plan, a))} if motions else {}
    stages = cut(
        [motion | base.V_column | base.A_column, needed.received],
        [_motion_outwards(core, options) | along, efforts],
    )
    return InverseModule(stages, at_q, at_v, tuple(sorted(core.platforms)), parts.tree_v[laws])


def _along_motions(core: Core, plan: Plan, a: Expression) -> Expression:
    """Return the accelerations along a module's motions, as `write_direct` does; `a` of the spanning tree."""
    y = np.array([a[k] if k >= 0 else 0.0 for k in plan.parts.v], dtype=object)
    for i, platform in core.platforms.items():
        y[np.array(core.chain.columns_of(i + 1)) - 6] = platform.A
    u_dot = y[plan.motions]
    for i, spin in enumerate(plan.parts.spins):
        u_dot[i] = along(spin.share, y[list(spin.cols)])
    return u_dot


def _motion_outwards(core: Core, options: InverseOptions) -> dict[str, ca.SX]:
    """Return the platforms' motion for the legs, and the motion of outputs that carry modules."""
    out: dict[str, ca.SX] = {}
    for i, motion in sorted(core.platforms.items()):
        out[f"platform {i}"] = motion.column()
    for o, body in enumerate(core.outputs):
        if options.carries[o]:
            V, A = _relative_motion(core.chain, body, options.velocity)
            out[f"V {o}"], out[f"A {o}"] = pack(V[-twist_width(options.velocity) :]), pack(A)
    return out


def _relative_motion(chain: Chain, body: int, velocity: bool) -> tuple[Expression, Expression]:
    """Return a body's twist and acceleration relative to an observer at its origin (`base_motion`)."""
    V, A = chain.V[body], chain.c[body]
    return (resting(V), classical(V, A)) if velocity else (V, A)


def _required_forces(
    core: Core, plan: Plan, options: InverseOptions, moving: Chain, a: Expression
) -> _RequiredForces:
    """Compute the forces that a motion requires, without joint laws; `a` as of the spanning tree.

    `moving` is the core's motion for inertial forces: its rates are zero without velocity terms.
    """
    parts, b = plan.parts, forces(moving)
    terms = [x * u for x, u in zip(b[6:], core.units, strict=True)]
    out = _RequiredForces(b, terms, plan.mechanism.length, {})
    for k, col in enumerate(parts.tree_v):
        if parts.v[k] >= 0 and options.rotor[col]:
            b[6 + k] = b[6 + k] + a[parts.v[k]] * options.rotor[col]
    for i in sorted({group[0].platform for group in parts.groups}):
        b_base, b_delta = (out.receive(f"{name} {i}") for name, _ in LEG_WRENCHES)
        at = core.chain.columns_of(i + 1)
        b[:6], b[at] = b[:6] + b_base - b_delta, b[at] + b_delta
        out.count(b_delta)
    for o in range(len(core.outputs)):
        _add_output(core, plan, options, o, out)
    return out


def _add_output(core: Core, plan: Plan, options: InverseOptions, o: int, out: _RequiredForces) -> None:
    """Add the wrench that an output and the modules on it require, Eqs. (30)-(32)."""
    chain, body = core.chain, core.outputs[o]
    own = own_inertia(plan, options.inertias[o], o)
    V, A = _relative_motion(chain, body, options.velocity)
    W = momentum(own, A)
    out.count(W)
    if options.velocity:
        W = W + crf(V, momentum(own, V))
    if options.carries[o]:
        F = out.receive(f"F {o}")
        W = W + F
        out.count(F)
    out.b = out.b + dot(motion_map(chain, body).T, to_parent(chain.R0[body], chain.p0[body], W))


def _efforts(
    core: Core, plan: Plan, options: InverseOptions, Psi: Expression, needed: _RequiredForces,
    pivots: Pivots | None,
) -> tuple[Expression, Any]:  # fmt: skip
    """Solve B tau = Psi^T b, Eq. (33), for the motor efforts; return them and the guard of the motor map."""
    parts, moving = plan.parts, options.moving
    B = _motor_map(core, plan, options, Psi, needed.received)[:, list(moving)]
    if len(moving) > B.shape[0] and not options.share:
        return zeros(len(options.motors)), ca.SX(np.inf)  # the general path raises the error
    size = needed.size() if len(moving) < B.shape[0] else ca.SX(0.0)
    free = plan.motions[len(parts.spins) :]
    summed = (size, plan.mechanism.reduction.col_scale[parts.tree_v[free]], plan.scale)
    tau = zeros(len(options.motors))
    tau[list(moving)], guard = motor_efforts(
        B, dot(Psi.T, needed.b[6:]), summed, np.array(options.share), pivots
    )
    return tau, guard


def _base_wrench(core: Core, b: Expression) -> Expression:
    """Compute the wrench that the base must exert on a module: its own and its platforms'."""
    F = b[:6]
    for i in sorted(core.chain.platforms):
        F = F + b[core.chain.columns_of(i + 1)]
    return F


def _without_rates(core: Core, plan: Plan, q: Expression, a: Expression, base: BaseMotion) -> Chain:
    """Compute the core's motion with zero rates, for inertial forces without velocity terms."""
    parts, chain = plan.parts, core.chain
    placed = {}
    for i in core.platforms:
        R, p, V = chain.R0[i + 1], chain.p0[i + 1], chain.V[i + 1]
        relative = V - to_child(R, p, base.V)
        w, x = V[3:], relative
        product = np.concatenate([cross(w, x[:3]) + cross(V[:3], x[3:]), cross(w, x[3:])])
        placed[i] = Placed(R, p, zeros(6), chain.c[i + 1] - product)
    tree_q = np.array([q[k] if k >= 0 else 0.0 for k in parts.q], dtype=object)
    tree_a = np.array([a[k] if k >= 0 else 0.0 for k in parts.v], dtype=object)
    return sweep(list(parts.links), tree_q, zeros(len(parts.v)), zeros(6), tree_a, base.A, placed)


def _motor_map(
    core: Core, plan: Plan, options: InverseOptions, Psi: Expression, inputs: dict[str, ca.SX]
) -> Expression:
    """Compute the motor map B, the work of each motor along each motion, shape (N, motors)."""
    parts = plan.parts
    columns: dict[int, Expression] = {int(col): Psi[k] for k, col in enumerate(parts.tree_v)}
    for n, group in enumerate(parts.groups):
        at = np.array(core.chain.columns_of(group[0].platform + 1)) - 6
        driven = [j for j, c in enumerate(group[0].tree_v) if int(c) in options.motors]
        if not driven:
            continue
        inputs[f"motors {n}"], entries = symbols(f"motors {n}", len(group) * len(driven) * 6)
        wrenches = entries.reshape(len(group), len(driven), 6)
        for i, leg in enumerate(group):
            for j, k in enumerate(driven):
                columns[int(leg.tree_v[k])] = dot(Psi[at].T, wrenches[i, j])
    if not options.motors:
        return zeros(Psi.shape[1], 0)
    return np.stack([columns[c] for c in options.motors], axis=1)


#: Wrenches that the legs of a platform require, on the base and along delta, and the size of each.
LEG_WRENCHES = (("b_base", 6), ("b_delta", 6))


def write_inverse_legs(plan: Plan, n: int, options: InverseOptions) -> tuple[list[Stage], Array]:
    """Write the inverse model of group n of a module, and return its stage and its legs' own numbers.

    The outputs are `LEG_WRENCHES`; "motors", wrenches along delta of unit efforts of the motors; and "guard".
    """
    group = plan.parts.groups[n]
    leg = group[0]
    lawful, driven = leg.among(options.laws), leg.among(options.motors)
    columns = {"q": symbols("q", len(leg.q)), "v": symbols("v", len(leg.v)), "a": symbols("a", len(leg.v))}
    q, v, a = (entries for _, entries in columns.values())
    base = base_motion(options.base, options.velocity)
    laws_column, laws = symbols("laws", len(lawful))
    p_column, platform = PlatformMotion.symbols(accelerations=True)
    written = write_leg(group, q, v, (base.V, base.A), platform, plan.scale, plan.leg_pivots[n], a)
    law = zeros(len(leg.v))
    law[lawful] = laws
    rotor = written.folding.array([np.array([options.rotor[c] for c in leg.tree_v]) for leg in group])
    b = forces(_moving(written, q, v, a, base, options.velocity))
    H = b[6:] - law + a * rotor
    outputs = {"b_base": pack(b[:6]), "b_delta": pack(written.wrench(dot(written.X.T, H)))}
    outputs["guard"] = ca.SX(written.guard)
    if driven:
        outputs["motors"] = pack(*(written.wrench(written.X[k]) for k in driven))
    inputs = {name: column for name, (column, _) in columns.items()} | base.V_column | base.A_column
    inputs |= {"laws": laws_column} if lawful else {}
    inputs |= {"numbers": written.folding.symbol(), "platform": p_column}
    return cut([inputs], [outputs]), written.folding.table(len(group))


def _moving(
    leg: WrittenLeg, q: Expression, v: Expression, a: Expression, base: BaseMotion, velocity: bool
) -> Chain:
    """Compute a leg's motion for inertial forces; its rates are zero without velocity terms."""
    if velocity:
        return leg.chain
    return sweep(leg.chain.links, q, zeros(len(v)), zeros(6), a, base.A)
