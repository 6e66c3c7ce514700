"""Wrenches that the joints and closures of one module transmit, over its spanning tree.

The bodies beyond a joint need a wrench for their motion. Closures produce what efforts leave of it along the
joints: their multipliers m have K^T m = left. Where rows are redundant, C has the columns of the pivots of K,
in scaled rows, and with C = Q [R; 0] the least multipliers are Q [R^-T left; 0]; the other columns of Q are
self-stresses.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from ...linkage.closures import TreeClosure
from ...linkage.motion import Motion
from ...spatial import Array, crf, wrench_to_base
from ...structure.bodies import Body
from ...structure.module import Module
from ...symbols import Expression, cross, dot, minus, plus, times
from .expressions import filled, numbers, zeros
from .guarded_elimination import TRUSTED_PIVOT, Pivots, Triangular, choose_pivots
from .reflected import Reflected
from .rigid import momentum, ten_expressions
from .scales import squares
from .states import generic_positions

#: Largest force along a motion that multipliers leave, of the terms of its sum, over the rounding of one
#: number: efforts that do not balance a motion determine no multipliers.
LEFT = 1e6


def body_needs(body: Body, motion: Motion, g: Array) -> Expression:
    """Compute the wrench that a body needs for its motion, shape (6,), own frame.

    Args:
        body: Its mass, its centre and its inertia there.
        motion: Its motion in the world, one body.
        g: Gravity, shape (3,), [m/s^2], world axes.
    """
    if body.massless:
        return zeros(6)
    w, w_dot, A = (dot(motion.R.T, x) for x in (motion.w, motion.w_dot, minus(motion.p_ddot, numbers(g))))
    V, inertia = np.concatenate([zeros(3), w]), ten_expressions(body)  # seen by who moves with the origin
    out: Expression = plus(momentum(inertia, np.concatenate([A, w_dot])), crf(V, momentum(inertia, V)))
    return out


class LoopForces(NamedTuple):
    """How a module's multipliers follow from forces along its joints.

    Attributes:
        pivots: Rows and freedoms of its closures that determine them.
        sizes: Usual size of the factors of rows that are redundant; empty if none is.
        stresses: Number of self-stresses.
    """

    pivots: Pivots
    sizes: tuple[float, ...]
    stresses: int


def loop_forces(module: Module) -> LoopForces:
    """Choose the pivots of a module's closures over its spanning tree, at generic postures."""
    m = module.mechanism
    closures, rank = m.spanning_closures, m.spanning_rank
    row_scale, col_scale = m.spanning_row_scale, m.spanning_col_scale
    if not closures.rows:
        return LoopForces(Pivots((), (), ()), (), 0)
    K = closures.matrix(m.spanning.sweep(generic_positions(module)))
    pivots = choose_pivots(K, rank, row_scale, col_scale)
    if not m.self_stresses:
        return LoopForces(pivots, (), 0)
    C = (K * row_scale[:, None] * col_scale)[:, :, list(pivots.cols)]
    factors = np.abs(np.linalg.qr(C)[1][:, range(rank), range(rank)])
    return LoopForces(pivots, tuple(np.median(factors, axis=0).tolist()), m.self_stresses)


@dataclass(frozen=True)
class Multipliers:
    """Multipliers of a module's rows.

    Attributes:
        least: The least ones, shape (rows,).
        stresses: Self-stresses, scaled alike, shape (rows, k).
        guard: What tells whether they can be trusted.
    """

    least: Expression
    stresses: Expression
    guard: Any


def multipliers(
    K: Expression, left: Expression, how: LoopForces, scales: tuple[Array, Array], eps: float
) -> Multipliers:
    """Compute the multipliers that produce the forces `left` along the joints, shape (nv,).

    Args:
        K: Rows of the closures, shape (rows, nv).
        how: The choice of pivots.
        scales: Factor of each row and unit of each freedom.
        eps: Rounding of one number.
    """
    row_scale, col_scale = (numbers(x) for x in scales)
    K = scaled(scaled(K, row_scale).T, col_scale).T
    needed = scaled(left[:, None], col_scale)[:, 0]
    rows, cols, stresses = [*how.pivots.rows], [*how.pivots.cols], zeros(len(K), how.stresses)
    if how.stresses:
        reflected = Reflected.of(K[:, cols])
        least, stresses = reflected.least(needed[cols]), reflected.unseen()
        inverses, sizes = 1.0 / reflected.R.diagonal(), [*how.sizes]
    else:
        factors, least = Triangular.of(K, how.pivots), zeros(len(K))
        least[rows] = factors.solve_transposed(needed[cols][:, None])[:, 0]
        inverses, sizes = factors.inverses, _scaled_sizes(how.pivots, scales)
    doubts = np.array(
        [times(TRUSTED_PIVOT * s, x) for s, x in zip(sizes, inverses, strict=True)], dtype=object
    )
    open_by = minus(dot(K.T, least), needed)
    size = ca.sqrt(squares(needed)) + ca.sqrt(squares(least)) + np.finfo(float).tiny
    guard = squares(doubts) + squares(open_by) / (LEFT * eps * size) ** 2
    return Multipliers(scaled(least[:, None], row_scale)[:, 0], scaled(stresses, row_scale), guard)


def scaled(M: Expression, factors: Expression) -> Expression:
    """Multiply each row of a matrix by its factor."""
    rows = [times(factor, x) for factor, row in zip(factors, M, strict=True) for x in row]
    return filled(rows, *M.shape)


def _scaled_sizes(pivots: Pivots, scales: tuple[Array, Array]) -> list[float]:
    """Return the usual sizes of pivots in scaled rows and columns."""
    each = zip(pivots.rows, pivots.cols, pivots.sizes, strict=True)
    return [size * float(scales[0][row] * scales[1][col]) for row, col, size in each]


def unit_wrenches(frames: tuple[Expression, ...], c: TreeClosure, about: Expression) -> Expression:
    """Compute the wrench on a closure's second body per unit of each multiplier, base axes, shape (6, rows).

    Args:
        frames: Axes of frame A, directions of the rotational rows (k, 3), and origin of frame B.
        about: Point about which moments are taken, shape (3,).
    """
    A, turns, at = frames
    arm = minus(at, about)
    pushes = [np.concatenate([A[:, i], cross(arm, A[:, i])]) for i in c.translations]
    columns = pushes + [np.concatenate([zeros(3), turn]) for turn in turns]
    return np.stack(columns, axis=1) if columns else zeros(6, 0)


def sums_inwards(parents: Sequence[int], needed: Sequence[Expression]) -> list[Expression]:
    """Add to what each body needs, shape (6, k), what the bodies beyond it need; base's frame for all."""
    total = [x.copy() for x in needed]
    for joint, parent in reversed([*enumerate(parents)]):
        total[parent] = plus(total[parent], total[joint + 1])
    return total


def in_base(motion: Motion, body: int, W: Expression) -> Expression:
    """Transform a wrench on a body of a module from its frame to the module's base."""
    return wrench_to_base(motion.R[0, body], motion.p[0, body], W)
