"""Write the balance of forces of one module at its accelerations, for the derivatives of both models.

It has four stages: outwards (motion), what is held of its loops (`held_loops`), what is left at this, and
what of it acts along its motions. The second one has no derivatives; a core without loops has one stage
inwards.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from ...symbols import dot
from .expressions import pack
from .held_loops import along_motions, held_loops, left_over
from .inverse import (
    guarded_motions,
    lawful,
    left_along,
    motion_outwards,
    required_forces,
    without_rates,
    wrench_on_base,
)
from .module_plan import ModulePlan
from .options import Options
from .stages import GivenColumns, WrittenModule, begun, cut, read_by_core


def write_balance_stages(plan: ModulePlan, options: Options) -> WrittenModule:
    """Write a module's balance of forces and cut it into its stages.

    The first one has the output "u_dot of core", the accelerations along the core's motions. What is left of
    the forces along these is "Q of core"; along an idle motion without inertia it is its acceleration, which
    the direct model makes zero.

    Args:
        options: Options of the balance: motor efforts are among the laws.
    """
    given, received, again, later = GivenColumns(), GivenColumns(), GivenColumns(), GivenColumns()
    core, (q, _, a), base = begun(plan, options, given, accelerations=True)
    chain = core.chain if options.velocity else without_rates(core, plan, q, a, base)
    forces = [required_forces(core, plan, options, chain, a, x)[0] for x in (received, again)]
    held = held_loops(core, plan, forces[0][6:], a)
    Psi, guard = guarded_motions(core, plan)
    if held.size:
        again["held"], known = held.again("held")
        rest, along_idle = left_over(core, plan, forces[1][6:], known)
        left = np.concatenate([left_along(core, plan, options, along_idle, a), rest])
        later["held"], known = held.again("held")
        of_idle, left_later = len(along_idle), later.take("left", len(left))
        Q = np.concatenate([left_later[:of_idle], dot(known["Psi"].T, left_later[of_idle:])])
        inwards = [
            {"guard": ca.SX(guard), "held": held.pack()},
            {"left": pack(left)} | wrench_on_base(core, options, forces[1]),
            {"Q of core": pack(Q)},
        ]
    else:
        Q = left_along(core, plan, options, dot(Psi.T, forces[0][6:]), a)
        whole = {"guard": ca.SX(guard), "Q of core": pack(Q)} | wrench_on_base(core, options, forces[0])
        inwards = [whole, {}, {}]
    u_dot = {"u_dot of core": pack(along_motions(core, plan, a)[1])}
    stages = cut([given, received, again, later], [motion_outwards(core, options) | u_dot, *inwards])
    if held.size:
        handed = [name for name in stages[1].outputs if isinstance(name, tuple)]
        assert not handed, f"what is held has no derivatives, so its stage hands on nothing else: {handed}"
    at = {"laws": plan.parts.tree_v[lawful(plan, options)]}
    return WrittenModule(stages, *read_by_core(plan), at, held)
