"""Inertias and forces of a group of equal legs, as the direct model sums them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...spatial import Array, cross, hat
from ...symbols import Expression, dot, minus, plus
from .chains import carried, forces, inertial_map, mass_matrix
from .expressions import congruence, numbers, pack, upper, zeros
from .legs import PlatformMotion, WrittenLeg, write_leg
from .module_plan import ModulePlan
from .options import Options
from .own_axes import rates_in_file
from .rigid import matrix_moved
from .rubbing_joints import of_legs
from .rubbing_legs import RubbingLeg
from .stages import Draft, GivenColumns, Stage, cut

#: Contributions of the legs of a platform (`leg_sums`), and the size of each.
LEG_SUMS = (("S1", 10), ("B", 36), ("L", 21), ("b_base", 6), ("b_delta", 6))


def write_direct_legs(
    plan: ModulePlan, n: int, options: Options, *, motion: bool = False
) -> tuple[list[Stage], Array]:
    """Write the direct model of group n of a module, and return its stages and its legs' own numbers.

    Args:
        motion: Whether one stage computes the accelerations "a" alone, also from those of idle motions.
    """
    group, given, later = plan.parts.groups[n], GivenColumns(), GivenColumns()
    leg, forced = group[0], group[0].among(options.motors)
    q, v = given.take("q", len(leg.q)), given.take("v", len(leg.v))
    platform = PlatformMotion.read(given.take("platform", 19))
    base = given.base_twist(options)
    tau = given.scattered("tau", forced, len(leg.v))
    written = write_leg(group, q, v, (base, zeros(6)), platform, plan.scale, plan.leg_pivots[n])
    rotor = written.folding.array([np.array([options.rotor[c] for c in leg.tree_v]) for leg in group])
    delta = later.take("delta", 6)
    if motion:
        a = leg_accelerations(written, delta)
        a = plus(a, written.idle.S * later.take("u_dot of leg", 1)) if written.idle else a
    else:
        if written.idle:
            written.idle = written.idle.decided(plan, written.folding, group, options.rotor)
        unforced, (sums, written) = written, leg_sums(written, tau, options.velocity, rotor)
        a = leg_accelerations(written, delta)
        if written.idle:
            a = plus(a, dot(sums["over_base"], later.base_acceleration(options)))
    outwards = Draft(later, {"a": pack(rates_in_file(written.chain.links, a))})
    if motion:
        outwards.given = GivenColumns({"numbers": written.folding.symbol()} | given | later)
        return cut([outwards]), written.folding.table(len(group))
    outputs = {name: pack(sums[name]) for name, _ in LEG_SUMS}
    rubbing = of_legs(options.rubbing, plan.parts)[n]
    if rubbing[0]:
        rubs = RubbingLeg.of(unforced, group, rubbing, v, plan.column)
        outputs["rubbing"] = pack(*_answers(written, rubs, sums, options))
    certain = written.idle.unforced(plan, sums["f"], leg.tree_v) if written.idle else 0.0
    outputs["guard"] = written.guarded(plan) + certain
    inputs = GivenColumns({"numbers": written.folding.symbol()} | given)  # with those that rubbing folds
    return cut([Draft(inputs, outputs), outwards]), written.folding.table(len(group))


def _answers(
    leg: WrittenLeg, rubs: RubbingLeg, sums: dict[str, Expression], options: Options
) -> list[Expression]:
    """Return `LegAnswers`, per [V_dot_base; delta].

    Args:
        leg: The leg, its idle motion free.
        rubs: Its joints that rub.
        sums: As of `leg_sums`.
    """
    chain, through = leg.chain, rubs.through
    per_s = rubs.required({joint + 1: inertial_map(chain, joint) for joint in rubs.joints})
    alone = dot(through, sums["needed"]) + dot(per_s[:, 6:], leg.y0)
    if options.velocity:
        alone = plus(alone, rubs.required(carried(chain)))
    per_joint = plus(per_s[:, 6:], dot(through, sums["A"]))
    per_base = per_s[:, :6] + dot(through, sums["D"].T) + dot(per_joint, sums["over_base"])
    per_delta = dot(per_joint, leg.X)
    per_delta[:, 3:] = per_delta[:, 3:] - dot(per_delta[:, :3], hat(leg.point))
    return [alone, np.concatenate([per_base, per_delta], axis=1), rubs.of_frictions(), rubs.pushes]


def leg_sums(
    leg: WrittenLeg, tau: Expression, velocity: bool, rotor: Expression
) -> tuple[dict[str, Expression], WrittenLeg]:
    """Compute a leg's contributions to the direct model, over [V_dot_base; delta], and free its idle motion.

    Args:
        tau: Generalised forces on its joints.
        velocity: Whether velocity terms are on.
        rotor: Rotor inertias of its joints, shape (nv,).

    Returns:
        "S1": ten numbers on the base; "B": M_base,delta row by row; "L": M_delta,delta, upper triangle;
        "b_base", "b_delta": forces at zero accelerations; "over_base": joint accelerations that the idle
        motion has over that of the base, shape (nv, 6); "f" and "needed": forces on the joints before and
        after it is free, at y0; "A", "D": the leg's inertia, Eq. (34).
        The leg, whose X and y0 have the acceleration of the idle motion.
    """
    M, S1 = mass_matrix(leg.chain)
    D, A = M[:6, 6:], M[6:, 6:]
    for i, inertia in enumerate(rotor):
        A[i, i] = A[i, i] + inertia
    bias = forces(leg.chain) if velocity else zeros(6 + leg.chain.nv)
    f = minus(plus(bias[6:], dot(A, leg.y0)), tau)
    needed, over_base = f, zeros(leg.chain.nv, 6)
    if leg.idle:
        freed = leg.idle.freed((D, A), (leg.X, leg.y0), f)
        leg, needed, over_base = replace(leg, X=freed.X, y0=freed.y0), freed.needed, freed.over_base
        S1 = np.concatenate([S1[:4], plus(S1[4:], upper(freed.turned))])
    B = dot(D, leg.X)
    B[:, 3:] = minus(B[:, 3:], dot(B[:, :3], hat(leg.point)))
    sums = {"over_base": over_base, "f": f, "needed": needed, "A": A, "D": D, "S1": S1, "B": B.ravel()} | {
        "L": upper(matrix_moved(congruence(leg.X, A), numbers(np.eye(3)), leg.point)),
        "b_base": plus(bias[:6], dot(D, leg.y0)),
        "b_delta": leg.wrench(dot(leg.X.T, needed)),
    }
    return sums, leg


def leg_accelerations(leg: WrittenLeg, delta: Expression) -> Expression:
    """Compute a leg's joint accelerations from its platform's relative acceleration, base's frame."""
    at_point = np.concatenate([plus(delta[:3], cross(delta[3:], leg.point)), delta[3:]])
    return np.asarray(plus(dot(leg.X, at_point), leg.y0))
