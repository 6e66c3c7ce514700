"""The inverse model of one module, written: Eqs. (30)-(33) in the form of `hybridyn.idm`.

Two stages: outwards (motion, and the forces of the core), inwards (motors' efforts, the base's wrench).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from ..spatial import Index
from .actuation import motor_efforts
from .chains import Chain, Placed, forces, motion_map, sweep
from .core import Core, Plan, own_inertia, write_core
from .direct import base_twist, parameters_of, read_by_core, scattered
from .expressions import Expression, cross, dot, pack, plain, symbols, zeros
from .guards import Scale, accelerating_apart, size_of, trusted
from .legs import PlatformMotion, WrittenLeg
from .links import units_of
from .rigid import classical, crf, momentum, motion_to_parent, resting, to_child, to_parent
from .staging import Stage, cut
from .static_elimination import Pivots, solve


@dataclass(frozen=True)
class InverseOptions:
    """What the code of a module depends on beside the module.

    Attributes:
        base: The base's acceleration (less gravity) where it is a constant and the base rests, else None.
        carries: For each output whether another module stands on it.
        inertias: For each output its ten numbers, with those that its modules' legs hand to it.
        velocity: Whether velocity terms are on.
        rotor: Rotor inertias over the freedoms of the tree after the cuts.
        motors: Freedoms of the tree after the cuts that are driven, in the order of the module's motors.
        share: Each motor's share of the load, where motors are redundant.
        laws: Freedoms of the core with joint laws.
    """

    base: tuple[float, ...] | None
    carries: tuple[bool, ...]
    inertias: tuple[tuple[float, ...], ...]
    velocity: bool
    rotor: tuple[float, ...]
    motors: tuple[int, ...]
    share: tuple[float, ...]
    laws: tuple[int, ...]


@dataclass(frozen=True)
class InverseModule:
    """The stages of one module's inverse model.

    Attributes:
        stages: Outwards, inwards.
        q, v: Coordinates of the spanning tree that the inputs "q", "v", "a" hold.
        platforms: Links of the core that are platforms.
        laws: Freedoms of the tree after the cuts that the input "laws" holds.
    """

    stages: list[Stage]
    q: Index
    v: Index
    platforms: tuple[int, ...]
    laws: Index


def write_inverse(name: str, plan: Plan, options: InverseOptions, pivots: Pivots) -> InverseModule:
    """Write a module's inverse model and cut it into its stages."""
    parts, m = plan.parts, plan.mechanism
    at_q, at_v = read_by_core(plan)
    q_col, q = scattered("q", at_q, m.spanning.nq)
    (v_col, v), (a_col, a) = scattered("v", at_v, m.spanning.nv), scattered("a", at_v, m.spanning.nv)
    (V_col, V_base), (A_col, A_base) = base_twist(options.velocity), symbols("A_base", 6)
    inputs: list[dict[str, ca.SX]] = [{"q": q_col, "v": v_col, "a": a_col} | parameters_of(plan), {}]
    outputs: list[dict[str, ca.SX]] = [{}, {}]
    if options.base is not None:
        V_base, A_base = zeros(6), plain(options.base)
    else:
        inputs[0] |= {"V_base": V_col, "A_base": A_col}
    core = write_core(plan, q, v, V_base, a, A_base)
    order = tuple(sorted(core.platforms))
    for i in order:
        motion, c = core.platforms[i], core.chain.c[i + 1]
        A = motion_to_parent(motion.R, motion.p, c)
        outputs[0][f"platform {i}"] = pack(motion.R, motion.p, motion.V, A)
    b, terms = _needed(core, plan, options, (q, v, a, V_base, A_base), outputs[0], inputs[1])
    laws = [k for k, col in enumerate(parts.tree_v) if int(col) in options.laws]
    law_col, law = symbols("laws", len(laws))
    if laws:
        inputs[1]["laws"] = law_col
    b[6 + np.array(laws, dtype=int)] = b[6 + np.array(laws, dtype=int)] - law

    X, trust = solve(core.rows.K[:, 6:], zeros(len(core.rows.K), 1), plan.loop_pivots)
    Psi = X[:, 1:]
    guard = ca.fmax(core.rows.guard, trusted(trust))
    guard = ca.fmax(
        guard, accelerating_apart(core.rows.apart, _haste(core, plan, a, A_base), plan.scale.closed)
    )
    B = _motor_map(core, plan, options, Psi, inputs[1])
    size = ca.SX(0.0)
    for value in terms if len(options.motors) < B.shape[0] else ():
        size = size + ca.fabs(value)
    if len(options.motors) > B.shape[0] and not options.share:
        tau, measure = zeros(0), ca.SX(np.inf)  # the general path says what is missing
    else:
        free = [k for k in range(len(parts.tree_v)) if k not in plan.loop_pivots.cols]
        summed = (size, m.reduction.col_scale[parts.tree_v[free]], plan.scale.closed)
        tau, measure = motor_efforts(B, dot(Psi.T, b[6:]), summed, np.array(options.share), pivots)
    outputs[1]["guard"] = ca.SX(ca.fmax(guard, measure))
    if len(tau):
        outputs[1]["tau"] = pack(tau)
    if options.base is None:
        F = b[:6]
        for i in range(len(parts.links)):
            if i in core.chain.platforms:
                F = F + b[core.chain.columns_of(i + 1)]
        outputs[1]["F_base"] = pack(F)
    return InverseModule(cut(name, inputs, outputs), at_q, at_v, order, parts.tree_v[laws])


def _needed(
    core: Core, plan: Plan, options: InverseOptions, given: tuple[Expression, ...],
    outputs: dict[str, ca.SX], inputs: dict[str, ca.SX],
) -> tuple[Expression, list[Any]]:  # fmt: skip
    """Give the generalised force that the motion needs over s = [base; y], without joint laws, and its terms.

    Terms are work per scaled coordinate, as far as one module can tell them apart.
    """
    parts, chain, length = plan.parts, core.chain, plan.mechanism.length
    b = forces(chain if options.velocity else _slow(core, plan, given))
    terms = [
        x * u
        for x, u in zip(
            b[6:], np.concatenate([np.zeros(0), *(units_of(j, length) for j in parts.links)]), strict=True
        )
    ]
    a = given[2]
    for k, col in enumerate(parts.tree_v):
        if parts.v[k] >= 0 and options.rotor[col]:
            b[6 + k] = b[6 + k] + a[parts.v[k]] * options.rotor[col]
    for i in sorted({group[0].platform for group in parts.groups}):
        for sum_name in ("b_base", "b_delta"):
            inputs[f"{sum_name} {i}"] = ca.SX.sym(f"{sum_name}_{i}", 6)
        b_base = np.array([inputs[f"b_base {i}"][k] for k in range(6)], dtype=object)
        b_delta = np.array([inputs[f"b_delta {i}"][k] for k in range(6)], dtype=object)
        at = chain.columns_of(i + 1)
        b[:6], b[at] = b[:6] + b_base - b_delta, b[at] + b_delta
        terms += [*(b_delta[:3] * length), *b_delta[3:]]
    for o, body in enumerate(core.outputs):
        own, V, A = own_inertia(plan, options.inertias[o], o), chain.V[body], chain.c[body]
        if options.velocity:
            A, V = classical(V, A), resting(V)
        W = momentum(own, A)
        terms += [*(W[:3] * length), *W[3:]]
        if options.velocity:
            W = W + crf(V, momentum(own, V))
        if options.carries[o]:
            inputs[f"F {o}"], F = symbols(f"F {o}", 6)
            outputs[f"V {o}"], outputs[f"A {o}"] = pack(V[3:] if options.velocity else V), pack(A)
            W = W + F
            terms += [*(F[:3] * length), *F[3:]]
        b = b + dot(motion_map(chain, body).T, to_parent(chain.R0[body], chain.p0[body], W))
    return b, terms


def _haste(core: Core, plan: Plan, a: Expression, A_base: Expression) -> Any:
    """Give the size of a core's accelerations."""
    own = np.array([a[k] if k >= 0 else 0.0 for k in plan.parts.v], dtype=object)
    motions = [A_base, *(core.chain.c[i + 1] for i in core.platforms)]
    return size_of(own, core.units, motions, plan.mechanism.length) + core.speed * core.speed


def _slow(core: Core, plan: Plan, given: tuple[Expression, ...]) -> Chain:
    """Give the core's motion with rates that count as zero in inertial forces."""
    q, _, a, V_base, A_base = given
    parts, chain = plan.parts, core.chain
    placed = {}
    for i in core.platforms:
        R, p, V = chain.R0[i + 1], chain.p0[i + 1], chain.V[i + 1]
        relative = V - to_child(R, p, V_base)
        w, x = V[3:], relative
        product = np.concatenate([cross(w, x[:3]) + cross(V[:3], x[3:]), cross(w, x[3:])])
        placed[i] = Placed(R, p, zeros(6), chain.c[i + 1] - product)
    tree_q = np.array([q[k] if k >= 0 else 0.0 for k in parts.q], dtype=object)
    tree_a = np.array([a[k] if k >= 0 else 0.0 for k in parts.v], dtype=object)
    return sweep(list(parts.links), tree_q, zeros(len(parts.v)), zeros(6), tree_a, A_base, placed)


def _motor_map(
    core: Core, plan: Plan, options: InverseOptions, Psi: Expression, inputs: dict[str, ca.SX]
) -> Expression:
    """Give B, the work of each motor along each motion, shape (N, motors)."""
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


def leg_forces(
    leg: WrittenLeg, given: tuple[Expression, ...], platform: tuple[PlatformMotion, Expression],
    law: Expression, rotor: Expression, driven: list[int], velocity: bool, scale: Scale,
) -> dict[str, Any]:  # fmt: skip
    """Give what a leg needs for a motion.

    Args:
        leg: The leg, written at zero accelerations.
        given: Its q, v, a, and twist and acceleration of its base.
        platform: Motion of its platform, and its acceleration in the base's frame.
        law: What joint laws give along its freedoms.
        rotor: Rotor inertias of its freedoms.
        driven: Its freedoms with motors.
        velocity: Whether velocity terms are on.
        scale: What closures are measured by.

    Returns:
        "b_base", "b_delta": wrenches on the base and along delta; "motors": wrench along delta of each
        motor's unit effort; "guard".
    """
    q, v, a, V_base, A_base = given
    links = leg.chain.links
    chain = sweep(links, q, v, V_base, a, A_base)
    moving = chain if velocity else sweep(links, q, zeros(len(v)), zeros(6), a, A_base)
    b = forces(moving)
    H = b[6:] - law
    for k, inertia in enumerate(rotor):
        H[k] = H[k] + a[k] * inertia
    out: dict[str, Any] = {"b_base": b[:6], "b_delta": leg.wrench(dot(leg.X.T, H))}
    out["motors"] = np.concatenate([zeros(0), *(leg.wrench(leg.X[k]) for k in driven)])
    A = platform[1]
    unit = np.concatenate([units_of(link, scale.length) for link in links])
    apart = leg.accelerating_apart(a, A - A_base) / unit
    haste = size_of(a, unit, [A, A_base], scale.length) + leg.speed * leg.speed
    out["guard"] = ca.fmax(leg.guard, accelerating_apart(apart, haste, scale.closed))
    return out
