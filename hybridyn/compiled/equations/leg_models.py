"""Write the direct and the inverse model of a group of equal legs."""

from __future__ import annotations

import casadi as ca
import numpy as np

from ...spatial import Array
from .chains import Chain, forces, sweep
from .core import Plan
from .expressions import Expression, dot, pack, symbols, zeros
from .legs import PlatformMotion, WrittenLeg, leg_accelerations, leg_sums, write_leg
from .options import DirectOptions, InverseOptions
from .quadratic_form import LEG_SUMS
from .stages import BaseMotion, Stage, base_motion, cut


def write_direct_legs(plan: Plan, n: int, options: DirectOptions) -> tuple[list[Stage], Array]:
    """Write the direct model of group n of a module, and return its stages and its legs' own numbers."""
    group = plan.parts.groups[n]
    leg, forced = group[0], group[0].among(options.motors)
    (q_column, q), (v_column, v) = symbols("q", len(leg.q)), symbols("v", len(leg.v))
    base = base_motion(options.base, options.velocity)
    p_column, platform = PlatformMotion.symbols(accelerations=False)
    tau_column, given = symbols("tau", len(forced))
    delta_column, delta = symbols("delta", 6)
    tau = zeros(len(leg.v))
    tau[forced] = given
    written = write_leg(group, q, v, (base.V, base.A), platform, plan.scale, plan.leg_pivots[n])
    rotor = written.folding.array([np.array([options.rotor[c] for c in leg.tree_v]) for leg in group])
    sums = leg_sums(written, tau, options.velocity, rotor)
    inputs = {"numbers": written.folding.symbol(), "q": q_column, "v": v_column, "platform": p_column}
    inputs |= base.V_column | ({"tau": tau_column} if forced else {})
    outputs = {name: pack(sums[name]) for name, _ in LEG_SUMS} | {"guard": ca.SX(written.guard)}
    follows = {"a": pack(leg_accelerations(written, delta))}
    stages = cut("legs", [inputs, {"delta": delta_column}], [outputs, follows])
    return stages, written.folding.table(len(group))


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
    return cut("legs", [inputs], [outputs]), written.folding.table(len(group))


def _moving(
    leg: WrittenLeg, q: Expression, v: Expression, a: Expression, base: BaseMotion, velocity: bool
) -> Chain:
    """Compute a leg's motion for inertial forces; its rates are zero without velocity terms."""
    if velocity:
        return leg.chain
    return sweep(leg.chain.links, q, zeros(len(v)), zeros(6), a, base.A)
