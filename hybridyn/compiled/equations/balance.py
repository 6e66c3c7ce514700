"""Write the balance of forces of one module at its accelerations: what is left of them along its motions.

The derivatives of both models follow from it, and it is the inverse model of a floating base that is pushed.
It has four stages: outwards (motion), what is held of its loops (`held_loops`), what is left at this, and
what of it acts along its motions. The second one has no derivatives; a core without loops has one stage
inwards.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from ...symbols import dot
from .expressions import pack
from .held_loops import along_motions, held_loops, left_along, left_over
from .inverse import (
    guarded_motions,
    lawful,
    motion_outwards,
    required_forces,
    without_rates,
    wrench_on_base,
)
from .module_plan import ModulePlan
from .options import Options
from .stages import Draft, WrittenModule, begun, cut, read_by_core


def write_balance_stages(plan: ModulePlan, options: Options) -> WrittenModule:
    """Write a module's balance of forces and cut it into its stages.

    The first one has the output "u_dot of core", the accelerations along the core's motions. What is left of
    the forces along these is "Q of core"; along an idle motion without inertia it is its acceleration, which
    the direct model makes zero.

    Args:
        options: Options of the balance: motor efforts are among the laws.
    """
    outwards, whole, rest, along = Draft(), Draft(), Draft(), Draft()
    core, (q, _, a), base = begun(plan, options, outwards.given, accelerations=True)
    chain = core.chain if options.velocity else without_rates(core, plan, q, a, base)
    b = required_forces(core, plan, options, chain, a, whole.given)[0]
    held = held_loops(core, plan, b[6:], a)
    Psi, guard = guarded_motions(core, plan)
    u_dot = pack(along_motions(core, plan, a)[1])
    outwards.wanted |= motion_outwards(core, options) | {"u_dot of core": u_dot}
    drafts, whole.wanted["guard"] = [outwards, whole], ca.SX(guard)
    if held.size:
        whole.wanted["held"] = held.pack()
        b = required_forces(core, plan, options, chain, a, rest.given)[0]
        rest.given["held"], known = held.again("held")
        apart, along_idle = left_over(core, plan, b[6:], known)
        left = np.concatenate([left_along(core, plan, options, along_idle, a), apart])
        rest.wanted |= {"left": pack(left)} | wrench_on_base(core, options, b)
        along.given["held"], known = held.again("held")
        of_idle, left_later = len(along_idle), along.given.take("left", len(left))
        Q = np.concatenate([left_later[:of_idle], dot(known["Psi"].T, left_later[of_idle:])])
        along.wanted["Q of core"] = pack(Q)
        drafts += [rest, along]
    else:
        Q = left_along(core, plan, options, dot(Psi.T, b[6:]), a)
        whole.wanted |= {"Q of core": pack(Q)} | wrench_on_base(core, options, b)
    stages = cut(drafts)
    if held.size:
        handed = [name for name in stages[1].outputs if isinstance(name, tuple)]
        assert not handed, f"what is held has no derivatives, so its stage hands on nothing else: {handed}"
    at = {"laws": plan.parts.tree_v[lawful(plan, options)]}
    return WrittenModule(stages, *read_by_core(plan), at, held)
