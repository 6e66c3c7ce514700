"""The outward sweep of the direct model: accelerations of a module, of its legs and of its wrists."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from ...spatial import Index, motion_to_body
from ...symbols import Expression
from .chains import Chain, Placed, motion_map, sweep
from .core import Core, whole
from .expressions import numbers, pack
from .guarded_elimination import solve
from .module_plan import ModulePlan
from .options import Options
from .own_axes import own_motion, own_rates, rates_in_file
from .rigid import classical
from .scales import squares
from .stages import GivenColumns
from .wrist_paths import wrist_jacobian


def accelerations_outwards(
    core: Core, options: Options, s: Expression, joints: list[int]
) -> dict[str, ca.SX]:
    """Return accelerations of the core's joints, of platforms less the base's, and of outputs, Eq. (53)."""
    out: dict[str, ca.SX] = {}
    if joints:
        out["a_core"] = pack(rates_in_file(core.chain.links, s[6:])[joints])
    for i in sorted(core.platforms):
        out[f"delta {i}"] = pack(s[core.chain.columns_of(i + 1)] - s[:6])
    for o, body in enumerate(core.outputs):
        if options.carries[o]:
            A = _accelerated(core.chain, body, s)
            out[f"A {o}"] = pack(classical(core.chain.V[body], A) if options.velocity else A)
    return out


def legs_on_paths(plan: ModulePlan) -> Index:
    """Return the freedoms of grouped legs on paths to wrists."""
    wrists = {int(col) for path in plan.parts.paths for col in path.v[path.own]}
    others = {int(col) for path in plan.parts.paths for col in path.v} - {*plan.parts.v.tolist()} - wrists
    return np.array(sorted(others), dtype=int)


def add_wrists(
    core: Core, plan: ModulePlan, given: tuple[Expression, Expression], base: tuple[Expression, Expression],
    s: Expression, received: GivenColumns,
) -> tuple[dict[int, Any], Any]:  # fmt: skip
    """Compute the wrists' accelerations by freedom of the spanning tree, and the guard of their pivots.

    Given are q and v of the spanning tree, twist and acceleration of the base, and s = [V_dot_base; y].
    `received` gets the legs' accelerations.
    """
    (q, v), parts, legs = given, plan.parts, legs_on_paths(plan)
    known = dict(zip(legs.tolist(), received.take("a_legs", len(legs)), strict=True))
    in_file = rates_in_file(parts.links, s[6:])
    known |= {int(col): in_file[k] for k, col in enumerate(parts.v) if col >= 0}
    chain = core.chain
    placed = {
        i: Placed(chain.R0[i + 1], chain.p0[i + 1], chain.V[i + 1], _accelerated(chain, i + 1, s))
        for i in core.platforms
    }
    out: dict[int, Any] = {}
    guard: Any = ca.SX(0.0)
    for path, pivots in zip(parts.paths, plan.wrist_pivots, strict=True):
        a = np.array([(known | out).get(int(col), 0.0) for col in path.v], dtype=object)
        a[path.own] = 0.0
        path_q, path_v, _ = own_motion(path, q, v)
        chain = sweep(path.links, path_q, path_v, base[0], own_rates(path.links, a), base[1], placed)
        target = _accelerated(core.chain, path.target, s)
        target = motion_to_body(numbers(path.wrist.R), numbers(path.wrist.p), target)
        miss = target - chain.c[path.end]
        X, doubts = solve(wrist_jacobian(path, chain), miss[:, None], pivots)
        out |= {int(col): value for col, value in zip(path.v[path.own], X[:, 0], strict=True)}
        guard = ca.fmax(guard, squares(doubts))
    return out, guard


def _accelerated(chain: Chain, body: int, s: Expression) -> Expression:
    """Compute a body's acceleration at s, own frame, shape (6,)."""
    return whole(chain, body, s, motion_map(chain, body))
