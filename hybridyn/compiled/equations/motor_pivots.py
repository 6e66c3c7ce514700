"""Choose the pivots of a module's motor map at generic postures."""

from __future__ import annotations

import casadi as ca
import numpy as np

from ...dynamics.guards import SINGULAR_MOTOR_MAP
from ...spatial import Array
from ..code.scalars import GUARD_LIMIT
from .chains import motion_map
from .core import Plan, motions_of, write_core
from .expressions import Expression, dot, pack, symbols, zeros
from .guards import Scale, trusted
from .legs import write_leg
from .static_elimination import Pivots, choose_pivots


def motor_pivots(plan: Plan, positions: Array, motors: tuple[int, ...]) -> Pivots | None:
    """Choose the pivots of a module's motor map at generic positions of its spanning tree.

    Args:
        positions: Positions of its spanning tree, shape (samples, nq).
        motors: Freedoms of the tree after the cuts that are driven and can move.

    Returns:
        The pivots; none if there are more motors than motions; None if the map is singular at most of the
        positions, and so everywhere.
    """
    if not motors or len(motors) > plan.mechanism.mobility - len(plan.parts.spins):
        return Pivots((), (), ())
    m, parts, loose = plan.mechanism, plan.parts, Scale(plan.scale.length, 1.0)
    column, q = symbols("q", m.spanning.nq)
    core = write_core(plan, q, zeros(m.spanning.nv), zeros(6))
    X, trust = motions_of(plan, core.rows.K[:, 6:], zeros(len(core.rows.K), 1))
    Psi, guard = X[:, 1 + len(parts.spins) :], trusted(trust)
    columns: dict[int, Expression] = {}
    for k, col in enumerate(parts.tree_v):
        columns[int(col)] = Psi[k]
    for n, group in enumerate(parts.groups):
        for leg in group:
            platform = core.platforms[leg.platform]
            written = write_leg(
                (leg,), q[leg.q], zeros(len(leg.v)), (zeros(6), zeros(6)), platform, loose, plan.leg_pivots[n]
            )
            guard = ca.fmax(guard, written.guard)
            at = core.chain.columns_of(leg.platform + 1)
            P = motion_map(core.chain, leg.platform + 1)[:, at]
            for k, col in enumerate(leg.tree_v):
                wrench = dot(P.T, written.wrench(written.X[k]))
                columns[int(col)] = dot(Psi[np.array(at) - 6].T, wrench)
    B = np.stack([columns[c] for c in motors], axis=1)
    function = ca.Function("B", [column], [pack(B), guard])
    maps = [function(x) for x in positions]
    good = np.array(
        [float(worst) <= GUARD_LIMIT for _, worst in maps]
    )  # B is no better than what it comes from
    samples = np.array([np.array(entries).reshape(B.shape) for entries, _ in maps])
    samples = samples[good if good.any() else np.isfinite(samples).all(axis=(1, 2))]
    size = np.abs(samples).max(axis=(0, 2))
    size = np.where(
        size > SINGULAR_MOTOR_MAP * size.max(), size, size.max()
    )  # motions without a motor: rounding
    unit = np.abs(samples / np.where(size > 0, size, 1.0)[:, None]).max(axis=(0, 1))
    size = np.where(
        size > SINGULAR_MOTOR_MAP * size.max(), size, size.max()
    )  # of a motion that no motor drives: rounding
    rows, cols = 1.0 / np.where(size > 0, size, 1.0), 1.0 / np.where(unit > 0, unit, 1.0)
    s = np.linalg.svd(samples * rows[:, None] * cols, compute_uv=False)
    regular = np.divide(s[:, -1], s[:, 0], out=np.zeros(len(s)), where=s[:, 0] > 0)  # dead centres: zero maps
    if np.median(regular) < SINGULAR_MOTOR_MAP:
        return None
    return choose_pivots(samples, len(motors), rows, cols)
