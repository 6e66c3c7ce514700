"""Idle motions of loops that follow what is given: which freedoms stand for them, and the least of them.

Positions of the motors leave the turn of a rod between two balls open. `assembly.assemble` takes the least
motion, in the units of the tree after the cuts, which is orthogonal to all idle motions. So do all programs,
by `least_norm`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ....assembly.free_motions import DRIVEN, IDLE, effects
from ....spatial import Array, Mask
from ....structure.mechanism import Mechanism
from ....structure.module import Module
from ....symbols import Expression, minus, times
from ..expressions import along
from ..guarded_elimination import Pivots
from ..states import generic_positions

#: Postures tell what is idle where the dependent freedoms have a reciprocal condition above this: rounding is
#: then far below `IDLE`.
TOLD = 1e-6
#: An idle motion moves no freedom by less than this part of its size: such numbers are rounding.
UNMOVED = 1e-12


def idle_freedoms(
    modules: Sequence[Module], K: Array, pivots: Pivots, left: Sequence[int]
) -> dict[int, Mask]:
    """Return the independent freedoms that move nothing but what is idle, and all that moves with each.

    Args:
        modules: Modules of one shape.
        K: Closure rows over the spanning tree at their generic postures, module by module, shape (samples,
            rows, nv).
        pivots: Pivots of the dependent freedoms.
        left: Independent freedoms that are not given.

    Returns:
        For each such freedom a mask, shape (nv,), by generic postures.
    """
    m, cols = modules[0].mechanism, list(pivots.cols)
    A = (K * m.spanning_col_scale)[:, list(pivots.rows)] * m.spanning_row_scale[list(pivots.rows), None]
    A = np.where(np.isfinite(A).all(axis=(1, 2), keepdims=True), A, 0.0)
    s = np.linalg.svd(A[:, :, cols], compute_uv=False)
    told: Mask = np.asarray(s.min(axis=1, initial=np.inf) > TOLD * s.max(axis=1, initial=0.0))
    idle, moving = set(left), np.zeros((m.spanning.nv, len(left)), dtype=bool)
    for module, own, at in zip(modules, np.split(A, len(modules)), np.split(told, len(modules)), strict=True):
        motions = np.zeros((at.sum(), m.spanning.nv, len(left)))
        motions[:, left, np.arange(len(left))] = 1.0
        motions[:, cols] = -np.linalg.solve(own[at][:, :, cols], own[at][:, :, left])
        motions /= np.linalg.norm(motions, axis=1, keepdims=True)
        moving |= (np.abs(motions) > UNMOVED).any(axis=0)
        moved = _moved(module, generic_positions(module)[at], motions)
        idle &= {c for c, size in zip(left, moved, strict=True) if size <= 1.0}
    return {c: moving[:, i] for i, c in enumerate(left) if c in idle}


def _moved(module: Module, q: Array, motions: Array) -> Array:
    """Return how much motions of the spanning tree move outputs and motors, over the limits of what is idle.

    Args:
        q: Positions, shape (T, nq).
        motions: Motions without units, shape (T, nv, count).

    Returns:
        Shape (count,).
    """
    m = module.mechanism
    motors = m.cut.v_in[module.motor_columns]
    outputs = effects(m, m.spanning.sweep(q), spanning=True) * m.spanning_col_scale
    moved = np.concatenate([outputs @ motions / IDLE, motions[:, motors] / DRIVEN], axis=1)
    return np.asarray(np.abs(moved).max(axis=(0, 1), initial=0.0))


def cut_weights(m: Mechanism) -> Array:
    """Return the weight of each freedom of the spanning tree in the norm of `least_norm`, shape (nv,).

    Joints of wrists that were cut have none: they follow the bodies that they connect.
    """
    out = np.zeros(m.spanning.nv)
    out[m.cut.v_from] = 1.0 / m.spanning_col_scale[m.cut.v_from]
    return out


def least_norm(found: Expression, motions: Expression, weight: Array) -> None:
    """Make solutions orthogonal to idle motions in place, by Gram and Schmidt, one motion after the other.

    Args:
        found: Solutions, shape (nv, k).
        motions: Idle motions, independent ones, shape (nv, count).
        weight: Weight of each freedom in the norm, shape (nv,).
    """
    rest = [motions[:, i].copy() for i in range(motions.shape[1])]
    columns = [found[:, i] for i in range(found.shape[1])]
    while rest:
        motion = rest.pop(0)
        dual = np.array([times(w * w, x) for w, x in zip(weight, motion, strict=True)], dtype=object)
        size = along(dual, motion)
        for column in (*rest, *columns):
            share = along(dual, column) / size
            column[:] = [minus(x, times(share, y)) for x, y in zip(column, motion, strict=True)]
