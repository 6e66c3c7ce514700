"""Idle motions of loops that follow what is given: which freedoms stand for them, and the least of them.

Positions of the motors leave the turn of a rod between two balls open. `assembly.assemble` takes the least
motion, in the units of the tree after the cuts, which is orthogonal to all idle motions. So do all programs,
by `least_norm`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ....spatial import Array, Mask
from ....structure.mechanism import Mechanism
from ....structure.module import Module
from ....symbols import Expression, minus, times
from ..expressions import along
from ..states import generic_positions
from .motion import idle_motions

#: An idle motion moves no freedom by less than this, without units: such numbers are rounding.
UNMOVED = 1e-12


def idle_freedoms(modules: Sequence[Module], left: Sequence[int]) -> dict[int, Mask]:
    """Return the independent freedoms that stand for idle motions, and all that moves with each.

    Args:
        modules: Modules of one shape.
        left: Independent freedoms of the spanning tree that are not given.

    Returns:
        For each such freedom a mask, shape (nv,), by generic postures.
    """
    each = [_standing(module, left) for module in modules]
    return {c: np.any([own[c] for own in each], axis=0) for c in left if all(c in own for own in each)}


def _standing(module: Module, left: Sequence[int]) -> dict[int, Mask]:
    """Return the freedoms that stand for the idle motions of a module: each moves one of those that are left.

    Joints of wrists that were cut follow the bodies that they connect.
    """
    m, out = module.mechanism, dict[int, Mask]()
    q, still = generic_positions(module)[-len(m.postures) :], np.zeros((len(m.postures), m.tree.nv))
    for motion in idle_motions(m, module.motor_columns):
        rates = still.copy()
        rates[:, list(motion.cols)] = motion.axis
        rates = m.spanning_rates(q, m.postures, rates, still)[0]
        moved: Mask = np.asarray((np.abs(rates / m.spanning_col_scale) > UNMOVED).any(axis=0))
        stands = [c for c in left if moved[c]]
        if len(stands) == 1:
            out[stands[0]] = moved
    return out


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
