"""Forces of a group of equal legs, as the inverse model sums them."""

from __future__ import annotations

import casadi as ca
import numpy as np

from ...spatial import Array
from ...symbols import dot, plus
from .chains import carried, forces, sweep
from .expressions import pack, zeros
from .legs import PlatformMotion, write_leg
from .module_plan import ModulePlan
from .options import Options
from .own_axes import own_rates
from .rubbing_joints import of_legs
from .rubbing_legs import RubbingLeg
from .stages import Draft, GivenColumns, Stage, cut

#: Wrenches that the legs of a platform require, on the base and along delta, and the size of each.
LEG_WRENCHES = (("b_base", 6), ("b_delta", 6))


def write_inverse_legs(
    plan: ModulePlan, n: int, options: Options, *, motions: bool = False
) -> tuple[list[Stage], Array]:
    """Write the inverse model of group n of a module, and return its stage and its legs' own numbers.

    The outputs are `LEG_WRENCHES`; "motors", wrenches along delta of unit efforts of the motors; "rubbing",
    `LegAnswers`; and "guard". With `motions` not friction, but those of an idle motion: "u_dot of leg" and
    "Q of leg" (as of `balance`).
    """
    group, given = plan.parts.groups[n], GivenColumns()
    leg, width = group[0], len(group[0].v)
    lawful, driven = leg.among(options.laws), leg.among(options.motors)
    q, v, a = given.take("q", len(leg.q)), given.take("v", width), given.take("a", width)
    base = given.base_twist(options), given.base_acceleration(options)
    law = given.scattered("laws", lawful, width)
    known, platform = dict(given), PlatformMotion.read(given.take("platform", 26))
    written = write_leg(group, q, v, base, platform, plan.scale, plan.leg_pivots[n], a)
    rotor = written.folding.array([np.array([options.rotor[c] for c in leg.tree_v]) for leg in group])
    own_a = own_rates(written.chain.links, a)
    moving = (
        written.chain
        if options.velocity
        else sweep(written.chain.links, written.q, zeros(width), zeros(6), own_a, base[1])
    )
    b = forces(moving)
    H = b[6:] - law + own_a * rotor
    outputs = {"b_base": pack(b[:6]), "b_delta": pack(written.wrench(dot(written.X.T, H)))}
    outputs["guard"] = ca.SX(written.guarded(plan))
    if motions and written.idle:
        idle = written.idle.decided(plan, written.folding, group, options.rotor)
        outputs["u_dot of leg"], outputs["Q of leg"] = (pack([x]) for x in idle.along(own_a, H))
    if driven:
        outputs["motors"] = pack(*(written.wrench(written.X[k]) for k in driven))
    rubbing = of_legs(options.rubbing, plan.parts)[n]
    if rubbing[0] and not motions:
        rubs = RubbingLeg.of(written, group, rubbing, v, plan.column)
        alone = plus(rubs.required(carried(moving)), dot(rubs.through, H))
        outputs["rubbing"] = pack(alone, -rubs.through[:, driven], rubs.of_frictions(), rubs.pushes)
    inputs = GivenColumns(known | {"numbers": written.folding.symbol()} | given)
    return cut([Draft(inputs, outputs)]), written.folding.table(len(group))
