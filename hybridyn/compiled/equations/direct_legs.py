"""Write the direct model of a group of equal legs.

It has two stages: the legs' contributions to their platform (`legs.leg_sums`), and their accelerations, once
the platform's is known.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from ...spatial import Array
from .core import Plan
from .expressions import pack, symbols, zeros
from .legs import PlatformMotion, leg_accelerations, leg_sums, write_leg
from .module_graph import base_motion
from .options import DirectOptions
from .quadratic_form import LEG_SUMS
from .stages import Stage, cut


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
