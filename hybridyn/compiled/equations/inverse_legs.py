"""Write the inverse model of a group of equal legs: wrenches on base and platform, and of the motors."""

from __future__ import annotations

import casadi as ca
import numpy as np

from ...spatial import Array
from .chains import Chain, forces, sweep
from .core import Plan
from .expressions import Expression, dot, pack, symbols, zeros
from .legs import PlatformMotion, WrittenLeg, write_leg
from .module_graph import BaseMotion, base_motion
from .options import InverseOptions
from .stages import Stage, cut

#: Wrenches that the legs of a platform require, on the base and along delta, and the size of each.
LEG_SUMS = (("b_base", 6), ("b_delta", 6))


def write_inverse_legs(plan: Plan, n: int, options: InverseOptions) -> tuple[list[Stage], Array]:
    """Write the inverse model of group n of a module, and return its stage and its legs' own numbers.

    The outputs are `LEG_SUMS`; "motors", the wrench along delta of a unit effort of each motor; and "guard".
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
