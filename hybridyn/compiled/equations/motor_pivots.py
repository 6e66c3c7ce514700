"""Which pivots a module's motor map is eliminated with, chosen at generic postures."""

from __future__ import annotations

import casadi as ca
import numpy as np

from ...spatial import Array
from .chains import motion_map
from .core import Plan, write_core
from .expressions import Expression, dot, pack, symbols, zeros
from .legs import write_leg
from .static_elimination import Pivots, choose_pivots, solve


def motor_pivots(plan: Plan, positions: Array, motors: tuple[int, ...]) -> Pivots:
    """Choose the pivots of a module's motor map at generic positions of its spanning tree.

    Args:
        plan: The module.
        positions: Positions of its spanning tree, shape (samples, nq).
        motors: Freedoms of the tree after the cuts that are driven.
    """
    m, parts = plan.mechanism, plan.parts
    column, q = symbols("q", m.spanning.nq)
    core = write_core(plan, q, zeros(m.spanning.nv), zeros(6))
    Psi = solve(core.rows.K[:, 6:], zeros(len(core.rows.K), 1), plan.loop_pivots)[0][:, 1:]
    columns: dict[int, Expression] = {}
    for k, col in enumerate(parts.tree_v):
        columns[int(col)] = Psi[k]
    for n, group in enumerate(parts.groups):
        for leg in group:
            platform = core.platforms[leg.platform]
            written = write_leg(
                (leg,), q[leg.q], zeros(len(leg.v)), zeros(6), platform, plan.scale, plan.leg_pivots[n]
            )
            at = core.chain.columns_of(leg.platform + 1)
            P = motion_map(core.chain, leg.platform + 1)[:, at]
            for k, col in enumerate(leg.tree_v):
                wrench = dot(P.T, written.wrench(written.X[k]))
                columns[int(col)] = dot(Psi[np.array(at) - 6].T, wrench)
    B = np.stack([columns[c] for c in motors], axis=1) if motors else zeros(Psi.shape[1], 0)
    if not motors or len(motors) > Psi.shape[1]:
        return Pivots((), (), ())
    function = ca.Function("B", [column], [pack(B)])
    samples = np.array([np.array(function(x)).reshape(B.shape) for x in positions])
    samples = samples[np.isfinite(samples).all(axis=(1, 2))]  # home may be singular
    size = np.abs(samples).max(axis=(0, 2))
    unit = np.abs(samples / np.where(size > 0, size, 1.0)[:, None]).max(axis=(0, 1))
    return choose_pivots(
        samples, len(motors), 1.0 / np.where(size > 0, size, 1.0), 1.0 / np.where(unit > 0, unit, 1.0)
    )
