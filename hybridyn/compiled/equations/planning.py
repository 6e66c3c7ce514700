"""Choose all pivots of a module, at generic postures."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...spatial import Array
from .core import PosedCore
from .expressions import sampled
from .guarded_elimination import Pivots, choose_pivots
from .idle.legs import other_rates
from .legs import leg_pivots
from .module_plan import ModulePlan
from .parts import Parts
from .scales import GUARD_CLOSED, OF_ROUNDED, TINY_RATE, Scale
from .states import seen_postures
from .wrist_paths import wrist_pivots


def plan_module(parts: Parts, positions: Array, dtype: str, *, compared: bool = True) -> ModulePlan:
    """Choose all pivots of a module.

    Args:
        parts: Its core and its legs.
        positions: Positions of its spanning tree at generic assembled postures, shape (samples, nq).
        dtype: Type of the arithmetic, "float64" or "float32".
        compared: As in `Scale`.
    """
    m = parts.mechanism
    postures = seen_postures(m)
    groups = []
    for group in parts.groups:
        leg = group[0]
        rows = np.array([1 / m.length] * 3 + [1.0] * (leg.closure.rows - 3))
        units = np.abs(other_rates(leg).T) @ m.reduction.col_scale[leg.tree_v]
        groups.append(leg_pivots(group, postures, (rows, units)))
    closed = max(GUARD_CLOSED[dtype], OF_ROUNDED * m.rounding if m.reduction.rounded else 0.0)
    wrists = [wrist_pivots(path, positions) for path in parts.paths]
    scale = Scale(m.length, closed, TINY_RATE[dtype], compared, float(np.finfo(dtype).eps))
    posed = PosedCore(ModulePlan(parts, Pivots((), (), ()), tuple(groups), tuple(wrists), scale))
    return replace(posed.plan, loop_pivots=_loop_pivots(posed, positions[-len(m.postures) :]), posed=posed)


def _loop_pivots(posed: PosedCore, positions: Array) -> Pivots:
    """Choose the pivots of the core's closures at positions of the spanning tree, shape (samples, nq)."""
    parts, m = posed.plan.parts, posed.plan.mechanism
    if not len(parts.closure_rows):
        return Pivots((), (), ())
    column, _, core = posed.written
    K = core.rows.K[:, 6:]
    units = m.reduction.col_scale[parts.tree_v]
    scales = m.reduction.row_scale[list(parts.closure_rows)], units
    return choose_pivots(sampled(K, [column], [[x] for x in positions]), parts.rank, *scales)
