"""Solve the motors' efforts of a module from the forces that its motion needs."""

from __future__ import annotations

from dataclasses import replace
from functools import reduce
from typing import Any

import casadi as ca
import numpy as np

from ...dynamics.guards import SINGULAR_MOTOR_MAP, UNDRIVEN
from ...spatial import Array
from ...structure.module import Module
from ...symbols import Expression, dot, is_zero, times
from ..code.scalars import GUARD_LIMIT
from .core import PosedCore, motions_of
from .expressions import evaluated, pack, zeros
from .guarded_elimination import TRUSTED_PIVOT, Pivots, choose_pivots, solve
from .legs import write_leg
from .module_plan import ModulePlan
from .reflected import Reflected
from .scales import Scale, squares, weighed
from .states import generic_positions


def motor_pivots(plan: ModulePlan, module: Module, motors: tuple[int, ...]) -> Pivots | None:
    """Choose the pivots of a module's motor map at generic positions of its spanning tree.

    Args:
        motors: Freedoms of the tree after the cuts that are driven and can move.

    Returns:
        The pivots; if there are more motors than motions, none, but the usual size of each motor's largest
        entry; None if the map is singular at most of the positions, and so everywhere.
    """
    if not motors:
        return Pivots((), (), ())
    motions, B, function = _motor_map(plan, motors)
    entries, worst = evaluated(function, [[x] for x in generic_positions(module)])
    samples = entries.reshape(len(entries), *B.shape)
    good = worst[:, 0] <= GUARD_LIMIT  # B is no better than what it comes from
    samples = samples[good if good.any() else np.isfinite(samples).all(axis=(1, 2))]
    if len(motors) > motions:
        usual = np.median(np.abs(samples).max(axis=1), axis=0) if len(samples) else np.zeros(len(motors))
        return Pivots((), (), tuple(usual.tolist()))
    size = np.abs(samples).max(axis=(0, 2))
    size = np.where(
        size > SINGULAR_MOTOR_MAP * size.max(), size, size.max()
    )  # motions without a motor: rounding
    size = np.where(size > 0, size, 1.0)
    unit = np.abs(samples / size[:, None]).max(axis=(0, 1))
    rows, cols = 1.0 / size, 1.0 / np.where(unit > 0, unit, 1.0)
    s = np.linalg.svd(samples * rows[:, None] * cols, compute_uv=False)
    regular = np.divide(s[:, -1], s[:, 0], out=np.zeros(len(s)), where=s[:, 0] > 0)  # dead centres: zero maps
    if np.median(regular) < SINGULAR_MOTOR_MAP:
        return None
    return choose_pivots(samples, len(motors), rows, cols)


def _motor_map(plan: ModulePlan, motors: tuple[int, ...]) -> tuple[int, Expression, ca.Function]:
    """Write a module's motor map B over positions of its spanning tree.

    Returns:
        The number of motions; B, shape (motions, motors); a function that computes it and its guard.
    """
    parts, loose = plan.parts, Scale(plan.scale.length, 1.0)
    posed: PosedCore = plan.posed
    column, q, core = posed.written
    X, doubts = motions_of(plan, core.rows.K[:, 6:], zeros(len(core.rows.K), 1))
    Psi, guard = X[:, 1 + plan.idle :], squares(doubts)
    columns: dict[int, Expression] = dict(zip(parts.tree_v.tolist(), Psi, strict=True))
    for n, group in enumerate(parts.groups):
        for leg in group:
            platform, base = core.platforms[leg.platform], (zeros(6), zeros(6))
            written = write_leg(
                (leg,), q[leg.q], zeros(len(leg.v)), base, platform, loose, plan.leg_pivots[n]
            )
            guard = ca.fmax(guard, written.guard)
            delta = Psi[np.array(core.chain.columns_of(leg.platform + 1)) - 6].T
            columns |= {
                int(c): dot(delta, written.wrench(x)) for c, x in zip(leg.tree_v, written.X, strict=True)
            }
    B = np.stack([columns[c] for c in motors], axis=1)
    return len(Psi[0]), B, ca.Function("B", [column], [pack(B), guard])


def motor_efforts(
    B: Expression, Q: Expression, terms: tuple[Any, Array, Scale], share: Array, pivots: Pivots | None
) -> tuple[Expression, Any]:
    """Compute the efforts of a module's motors and the guard of the motor map.

    Args:
        B: Work of each motor along each motion, shape (N, motors).
        Q: Required generalised force, shape (N,).
        terms: The size of the terms of Q as work per scaled coordinate [N m], the unit of each motion,
            shape (N,), and the scales of closure residuals.
        share: Each motor's share of the load if there are more motors than motions, shape (motors,).
        pivots: Pivots of B, or the usual size of its entries (`motor_pivots`).
    """
    N, motors = B.shape
    if not motors:
        return zeros(0), _undriven(Q, *terms)
    if motors > N and len(share) and pivots is not None:
        return _least_norm(B, Q, share, float(max(share * pivots.sizes)))
    if motors > N or pivots is None:  # no share, or singular at every posture: the general path raises
        return zeros(motors), ca.SX(np.inf)
    X, doubts = solve(B, Q[:, None], pivots)
    guard = squares(doubts)
    if motors < N:
        guard = guard + _undriven(Q - dot(B, X[:, 0]), *terms)
    return X[:, 0], guard


def _undriven(left: Expression, size: Any, units: Array, scale: Scale) -> Any:
    """Return the guard of generalised forces that no motor can produce."""
    if all(is_zero(x) for x in left):
        return ca.SX(0.0)
    limits = replace(scale, closed=min(scale.closed, UNDRIVEN))
    return weighed([(left * units, 1.0)], limits.weight(size))


def _least_norm(B: Expression, Q: Expression, share: Array, usual: float) -> tuple[Expression, Any]:
    """Compute tau of least |tau / share| with B tau = Q by a Householder LQ factorisation of B share.

    Args:
        usual: Usual size of the largest entry of B share: where all motors lose all motions, the largest
            pivot is rounding, too.
    """
    N, motors = B.shape
    A = np.array([[times(B[i, j], float(share[j])) for i in range(N)] for j in range(motors)], dtype=object)
    factors = Reflected.of(A)
    y, pivots = factors.least(Q), factors.R.diagonal()
    small = reduce(ca.fmin, map(ca.fabs, pivots), ca.SX(np.inf))
    big = reduce(ca.fmax, map(ca.fabs, pivots), ca.SX(usual))
    tau = np.array([times(float(s), x) for s, x in zip(share, y, strict=True)], dtype=object)
    ratio = ca.if_else(big > 0, small / big, 0.0)  # fmax would ignore the NaN of 0 / 0
    return tau, 2.0 - ratio / TRUSTED_PIVOT
