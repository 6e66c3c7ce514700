"""Bounds of the solutions of all right-hand sides of a size, by factors of the rows."""

from __future__ import annotations

from itertools import takewhile

import casadi as ca
import numpy as np

from ...symbols import Expression, plus, times
from ..equations.expressions import along, eye, pack, zeros
from ..equations.guarded_elimination import Pivots, Triangular

#: Operations that bounds by the inverse of a block may take beyond those by triangular factors, as a part of
#: these. Bounds of the turning of shipped robots are up to 14 times lower by it.
INVERTED = 0.1


def largest_solutions(K: Expression, size: Expression, pivots: Pivots) -> Expression:
    """Bound the unknowns of K x = y for every y with abs(y) <= size.

    The last unknowns are bounded by the absolute inverse of their block, as many as `INVERTED` lets. The
    others are bounded by the absolute triangular factors, which takes fewer operations and loses little for
    sparse rows.

    Args:
        K: Matrix, shape (m, n).
        size: Bounds of the right-hand side, shape (m,).
        pivots: Those of the unknowns; others are zero.

    Returns:
        Bounds of abs(x), shape (n,).
    """
    f, reach = Triangular.of(K, pivots), size[list(pivots.rows)]
    tries = (_bounded(f, reach, first) for first in reversed(range(len(reach) + 1)))
    by_factors, bounds = next(tries), zeros(K.shape[1])
    most = (1.0 + INVERTED) * ca.n_nodes(pack(by_factors))
    bounds[list(pivots.cols)] = [
        by_factors,
        *takewhile(lambda x: ca.n_nodes(pack(x)) <= most, tries),
    ][-1]
    return bounds


def _bounded(f: Triangular, size: Expression, first: int) -> Expression:
    """Bound unknowns by the inverse of the block from the first row on, and before it by factors, shape (n,).

    Args:
        f: The factors.
        size: Bounds of the right-hand side in the order of the pivots, shape (n,).
        first: First row of the block.
    """
    rank, reach = len(size), size.copy()
    for i in range(first):
        for j in range(i + 1, rank):
            reach[j] = plus(reach[j], times(ca.fabs(f.lower[j, i]), reach[i]))
    inverse, out = f.part(slice(first, rank)).solve(eye(rank - first)), zeros(rank)
    for i in range(first, rank):
        out[i] = along(np.array([ca.fabs(x) for x in inverse[i - first]], dtype=object), reach[first:])
    for i in reversed(range(first)):
        known = [times(ca.fabs(f.upper[i, c]), out[c]) for c in range(i + 1, rank)]
        out[i] = times(ca.fabs(f.inverses[i]), sum(known, reach[i]))
    return out
