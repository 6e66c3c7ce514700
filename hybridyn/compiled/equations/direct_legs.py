"""Inertias and forces of a group of equal legs, as the direct model sums them."""

from __future__ import annotations

import numpy as np

from ...spatial import Array
from ...symbols import dot, plus, times
from .core import leg_guard, spins_of_legs
from .expressions import along, pack, zeros
from .least_inertia import unforced_spins
from .legs import PlatformMotion, leg_accelerations, leg_sums, write_leg
from .module_plan import ModulePlan
from .options import Options
from .stages import GivenColumns, Stage, cut

#: Contributions of the legs of a platform (`legs.leg_sums`), and the size of each.
LEG_SUMS = (("S1", 10), ("B", 36), ("L", 21), ("b_base", 6), ("b_delta", 6))


def write_direct_legs(
    plan: ModulePlan, n: int, options: Options, *, motion: bool = False
) -> tuple[list[Stage], Array]:
    """Write the direct model of group n of a module, and return its stages and its legs' own numbers.

    Args:
        motion: Whether one stage computes the accelerations "a" alone, also from those of spins.
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
        a = plus(a, written.S * later.take("u_dot of leg", 1)) if written.spin else a
    else:
        spinning, certain = spins_of_legs(plan, written, group, options.rotor)
        sums, written = leg_sums(written, tau, options.velocity, rotor, spinning)
        a = leg_accelerations(written, delta)
        if written.spin:
            a = plus(a, dot(sums["over_base"], later.base_acceleration(options)))
    inputs = {"numbers": written.folding.symbol()} | given
    if motion:
        return cut([inputs | later], [{"a": pack(a)}]), written.folding.table(len(group))
    outputs = {name: pack(sums[name]) for name, _ in LEG_SUMS}
    if written.spin:
        left = np.array([times(1.0 - spinning, along(written.S, sums["f"]))], dtype=object)
        certain = certain + unforced_spins(plan, left, sums["f"], leg.tree_v)
    outputs["guard"] = leg_guard(plan, written) + certain
    return cut([inputs, later], [outputs, {"a": pack(a)}]), written.folding.table(len(group))
