"""The outward sweep of the direct model: accelerations of a module, of its legs and of its wrists."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from ...spatial import Index, motion_to_body
from ...symbols import Expression
from .chains import motion_map, sweep
from .core import Core, core_body, whole
from .expressions import numbers, pack
from .guarded_elimination import solve
from .module_plan import ModulePlan
from .options import Options
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
        out["a_core"] = pack(s[6:][joints])
    for i in sorted(core.platforms):
        out[f"delta {i}"] = pack(s[core.chain.columns_of(i + 1)] - s[:6])
    for o, body in enumerate(core.outputs):
        if options.carries[o]:
            A = whole(core.chain, body, s, motion_map(core.chain, body))
            out[f"A {o}"] = pack(classical(core.chain.V[body], A) if options.velocity else A)
    return out


def legs_on_paths(plan: ModulePlan) -> Index:
    """Return the freedoms of grouped legs on paths to wrists."""
    own = {int(col) for col in plan.parts.v if col >= 0}
    wrists = {int(col) for path in plan.paths for col in path.v[path.wrist_v]}
    return np.array(sorted({int(c) for path in plan.paths for c in path.v} - own - wrists), dtype=int)


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
    known |= {int(col): s[6 + k] for k, col in enumerate(parts.v) if col >= 0}
    out: dict[int, Any] = {}
    guard: Any = ca.SX(0.0)
    for path, pivots in zip(plan.paths, plan.wrist_pivots, strict=True):
        a = np.array([(known | out).get(int(col), 0.0) for col in path.v], dtype=object)
        a[path.wrist_v] = 0.0
        chain = sweep(list(path.links), q[path.q], v[path.v], base[0], a, base[1])
        body = core_body(plan, path.wrist.target)
        target = whole(core.chain, body, s, motion_map(core.chain, body))
        target = motion_to_body(numbers(path.wrist.R), numbers(path.wrist.p), target)
        miss = target - chain.c[-1]
        X, doubts = solve(wrist_jacobian(path, chain), miss[:, None], pivots)
        out |= {int(col): value for col, value in zip(path.v[path.wrist_v], X[:, 0], strict=True)}
        guard = ca.fmax(guard, squares(doubts))
    return out, guard
