"""Write the inverse model of one module: Eqs. (30)-(33) in the form of `hybridyn.idm`.

It has two stages: outwards (motion and the forces of the core) and inwards (motor efforts and the base's
wrench). Motor efforts solve B tau = Q, with the generalised force along each motion.
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from ...spatial import crf, crm, motion_to_body, wrench_to_base
from ...symbols import Expression, dot, minus, plus
from .chains import Chain, Placed, forces, motion_map, sweep
from .core import Core, motions_of, own_inertia, rank_guard
from .driven import Driven, motor_columns
from .expressions import pack, pick, zeros
from .guarded_elimination import Pivots
from .inverse_legs import LEG_WRENCHES
from .module_plan import ModulePlan
from .options import Options
from .own_axes import own_motion, own_rates
from .rigid import classical, momentum, resting
from .scales import squares
from .stages import Draft, GivenColumns, WrittenModule, begun, cut, read_by_core, twist_width


def write_inverse(
    plan: ModulePlan, options: Options, pivots: Pivots | None, *, frictions: bool = False
) -> WrittenModule:
    """Write a module's inverse model and cut it into its stages.

    Args:
        options: Options of the inverse model.
        pivots: Pivots of the motor map.
        frictions: Whether friction that grows with load is an output, "n" in the order of `options.rubbing`.
    """
    outwards, inwards = Draft(), Draft()
    core, (q, v, a), base = begun(plan, options, outwards.given, accelerations=True)
    chain = core.chain if options.velocity else without_rates(core, plan, q, a, base)
    b, terms, outputs = required_forces(core, plan, options, chain, a, inwards.given)
    X, guard = guarded_motions(core, plan)
    driven = Driven(plan, options, motor_columns(core, plan, options, inwards.given), X, terms, pivots)
    if options.rubbing:
        b, n, settled = driven.with_friction(core, (chain, v), b, outputs, inwards.given)
        guard = guard + settled
        inwards.wanted |= {"n": pack(n)} if frictions else {}
    tau, measure = driven.efforts(b[6:])  # Eq. (33)
    outwards.wanted |= motion_outwards(core, options)
    inwards.wanted |= {"guard": ca.SX(guard + measure)} | ({"tau": pack(tau)} if len(tau) else {})
    inwards.wanted |= {"size_base": pack([driven.size])} if options.measured else {}
    inwards.wanted |= wrench_on_base(core, options, b)
    at = {"laws": plan.parts.tree_v[lawful(plan, options)]}
    return WrittenModule(cut([outwards, inwards]), *read_by_core(plan), at)


def lawful(plan: ModulePlan, options: Options) -> list[int]:
    """Return the freedoms of the core on which laws act."""
    return [k for k, col in enumerate(plan.parts.tree_v) if int(col) in options.laws]


def guarded_motions(core: Core, plan: ModulePlan) -> tuple[Expression, Any]:
    """Return a core's motions, shape (n, motions), and the guard of its loops and of their rank."""
    X, doubts = motions_of(plan, core.rows.K[:, 6:], zeros(len(core.rows.K), 1))
    return X[:, 1:], rank_guard(plan, core.rows, core.rows.guard + squares(doubts), X[:, 1:])


def wrench_on_base(core: Core, options: Options, b: Expression) -> dict[str, ca.SX]:
    """Return the wrench on a base that moves, of forces over s, as an output."""
    platforms = (b[core.chain.columns_of(i + 1)] for i in sorted(core.chain.platforms))
    return {"F_base": pack(sum(platforms, b[:6]))} if options.base is None else {}


def motion_outwards(core: Core, options: Options) -> dict[str, ca.SX]:
    """Return the platforms' motion for the legs, and the motion of outputs that carry modules."""
    out = core.platform_columns()
    for o, body in enumerate(core.outputs):
        if options.carries[o]:
            V, A = _relative_motion(core.chain, body, options.velocity)
            out[f"V {o}"], out[f"A {o}"] = pack(V[-twist_width(options.velocity) :]), pack(A)
    return out


def _relative_motion(chain: Chain, body: int, velocity: bool) -> tuple[Expression, Expression]:
    """Return a body's twist and acceleration for an observer at its origin (`GivenColumns.base_twist`)."""
    V, A = chain.V[body], chain.c[body]
    return (resting(V), classical(V, A)) if velocity else (V, A)


def required_forces(
    core: Core, plan: ModulePlan, options: Options, moving: Chain, a: Expression, received: GivenColumns
) -> tuple[Expression, list[Any], list[Expression]]:
    """Compute the forces that a motion requires beyond joint laws; `a` as of the spanning tree.

    Args:
        moving: The core's motion for inertial forces: its rates are zero without velocity terms.
        received: Filled with the wrenches that other kernels provide.

    Returns:
        b: The forces over s = [base; y], shape (6 + n,).
        terms: The terms of their sum, as work per scaled coordinate; of a module on an output one sum of all.
        outputs: The wrench that each output needs, own frame.
    """
    parts, b = plan.parts, forces(moving)
    terms = [x * u for x, u in zip(b[6:], plan.mechanism.reduction.col_scale[parts.tree_v], strict=True)]
    own_a = own_rates(parts.links, pick(a, parts.v))
    for k, col in enumerate(parts.tree_v):
        if parts.v[k] >= 0 and options.rotor[col]:
            b[6 + k] = b[6 + k] + own_a[k] * options.rotor[col]
    for i in sorted({group[0].platform for group in parts.groups}):
        b_base, b_delta = (received.take(f"{name} {i}", size) for name, size in LEG_WRENCHES)
        at = core.chain.columns_of(i + 1)
        b[:6], b[at] = minus(plus(b[:6], b_base), b_delta), plus(b[at], b_delta)
        terms += _works(b_delta, plan)
    outputs = [_add_output(core, plan, options, o, b, terms, received) for o in range(len(core.outputs))]
    lawful_rows = 6 + np.array(lawful(plan, options), dtype=int)
    b[lawful_rows] = b[lawful_rows] - received.take("laws", len(lawful_rows))
    return b, terms, outputs


def _works(wrench: Expression, plan: ModulePlan) -> list[Any]:
    """Return the entries of a wrench as work per scaled coordinate."""
    return [*(wrench[:3] * plan.mechanism.length), *wrench[3:]]


def _add_output(
    core: Core,
    plan: ModulePlan,
    options: Options,
    o: int,
    b: Expression,
    terms: list[Any],
    received: GivenColumns,
) -> Expression:
    """Add the wrench that an output and the modules on it require, Eqs. (30)-(32); return it."""
    chain, body = core.chain, core.outputs[o]
    own = own_inertia(plan, options.inertias[o], o)
    V, A = _relative_motion(chain, body, options.velocity)
    W = momentum(own, A)
    terms += _works(W, plan)
    if options.velocity:
        W = plus(W, crf(V, momentum(own, V)))
    if options.carries[o]:
        F = received.take(f"F {o}", 6)
        W = plus(W, F)
        terms += received.take(f"size {o}", 1).tolist() if options.measures else _works(F, plan)
    b[:] = plus(b, dot(motion_map(chain, body).T, wrench_to_base(chain.R0[body], chain.p0[body], W)))
    return W


def without_rates(
    core: Core, plan: ModulePlan, q: Expression, a: Expression, base: tuple[Expression, Expression]
) -> Chain:
    """Compute the core's motion with zero rates, for inertial forces without velocity terms."""
    parts, chain = plan.parts, core.chain
    placed = {}
    for i in core.platforms:
        R, p, V = chain.R0[i + 1], chain.p0[i + 1], chain.V[i + 1]
        product = crm(V, V - motion_to_body(R, p, base[0]))
        placed[i] = Placed(R, p, zeros(6), chain.c[i + 1] - product)
    tree_q, still, tree_a = own_motion(parts, q, zeros(plan.mechanism.spanning.nv), a)
    return sweep(parts.links, tree_q, still, zeros(6), tree_a, base[1], placed)
