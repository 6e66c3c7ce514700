"""Columns of derivatives over coordinates, and products and eliminations of small dense matrices.

Positions are differentiated in the tangent space. One row or one column is in each lane. A matrix that all
lanes read is stored for all of them, by rows or by columns.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Any

import casadi as ca
import numpy as np

from ....joints.displacement import rate
from ....joints.kinds import JointKind
from ....spatial import Index, Mask
from ....structure.robot import HybridRobot
from ....symbols import Expression, dot
from ...equations.expressions import eye, pack, symbols, zeros
from ...equations.factors import Definite
from ...program import Each, Own, Shared, Source, Target
from ..writer import Writer
from .nodes import Number
from .sweeps import DENSE, PART, Block, Sweep


@dataclass(frozen=True, eq=False)
class ModuleCoordinates:
    """Coordinates of one module, or of a base with a prescribed motion.

    Attributes:
        q: Indices of its coordinates in the robot's q.
        v: Indices of its freedoms in the robot's v.
        kinds: Kinds of its joints, in the order of q and v.
    """

    q: Index
    v: Index
    kinds: tuple[JointKind, ...]


def coordinates_of(robot: HybridRobot) -> list[ModuleCoordinates]:
    """Return the coordinates of each module, preceded by those of a base with a prescribed motion."""
    modules = [set(module.v_index.tolist()) for module in robot.modules]
    left = set(range(robot.nv)).difference(*modules)
    return [coordinates_of_freedoms(robot, x) for x in ([left] if left else []) + modules]


def coordinates_of_freedoms(robot: HybridRobot, freedoms: set[int]) -> ModuleCoordinates:
    """Return the coordinates of some freedoms."""
    joints = [i for i, at in enumerate(robot.v_slices) if at.start in freedoms]
    q = [k for i in joints for k in range(robot.q_slices[i].start, robot.q_slices[i].stop)]
    v = [k for i in joints for k in range(robot.v_slices[i].start, robot.v_slices[i].stop)]
    return ModuleCoordinates(np.array(q, int), np.array(v, int), tuple(robot.kinds[i] for i in joints))


def collect(
    sweep: Sweep, numbers: Sequence[Number], target: Target, at: ModuleCoordinates | None = None
) -> None:
    """Add the call that adds up the tangents or adjoints of numbers.

    Args:
        sweep: The tangents or adjoints.
        numbers: The numbers.
        target: Target of the sums.
        at: Coordinates whose positions the numbers are: the sums are taken along their freedoms.
    """
    w, reading = sweep.writer, sweep.reading(numbers)
    turning = at is not None and not all(kind.additive for kind in at.kinds)
    kinds: tuple[JointKind, ...] = at.kinds if at and turning else ()
    q: list[Source] = [w.from_given("q", np.tile(at.q, (sweep.lanes, 1)))] if at and turning else []

    def function() -> ca.Function:
        """Return the sums."""
        columns, values = reading.symbols()
        if kinds:
            column, x = symbols("q", len(values))
            columns, values = [column, *columns], [*dot(tangent(kinds, x).T, np.array(values, dtype=object))]
        return ca.Function("collect", columns, [pack(values)])

    kernel = w.kernel(("collect", reading.key, kinds), function, PART)
    w.call(kernel, sweep.lanes, [*q, *reading.blocks], [target])


def tangent(kinds: Sequence[JointKind], x: Expression) -> Expression:
    """Return the derivatives of joints' coordinates over their freedoms, shape (nq, nv)."""
    out = zeros(len(x), sum(kind.nv for kind in kinds))
    i = j = 0
    for kind in kinds:
        n, m = kind.nq, kind.nv
        units = [rate(kind, x[i : i + n], unit) for unit in eye(m)]
        out[i : i + n, j : j + m] = np.stack(units, axis=1)
        i, j = i + n, j + m
    return out


def changes_of_coordinates(w: Writer, at: ModuleCoordinates, along: Block, count: int) -> Block:
    """Return changes of coordinates from those along freedoms, one column in each lane."""
    if all(kind.additive for kind in at.kinds):
        return along

    def function() -> ca.Function:
        """Return the change of coordinates of one column."""
        (column, x), (moved, given) = symbols("q", len(at.q)), symbols("v", len(at.v))
        return ca.Function("coordinates", [column, moved], [pack(dot(tangent(at.kinds, x), given))])

    out = w.own(count, len(at.q))
    kernel = w.kernel(("coordinates", at.kinds), function, PART)
    w.call(kernel, count, [w.from_given("q", np.tile(at.q, (count, 1))), along], [out])
    return out


def matrix(name: str, rows: int, columns: int) -> tuple[ca.SX, Expression]:
    """Return symbols of a matrix, as a column and as a matrix."""
    column, entries = symbols(name, rows * columns)
    return column, entries.reshape(rows, columns)


#: A matrix for all lanes, stored column by column, and the column that it is multiplied with in each lane.
Term = tuple[Shared, Own | Each]


def by_columns(all: Each, first: int, count: int) -> Shared:
    """Return some columns of a matrix that is stored column by column, for all lanes."""
    return Shared(all.start + first * all.size, count * all.size)


def add_terms(
    w: Writer,
    copies: int,
    size: int,
    terms: Sequence[Term],
    more: Sequence[Own | Each],
    target: Target,
    mapped: tuple[Each, Mask] | None = None,
    after: Sequence[Own | Each] = (),
) -> None:
    """Add the call that writes sum_i A_i x_i + sum_j y_j, one column in each lane.

    Args:
        w: The program under construction.
        copies: Number of columns.
        size: Number of rows of the result.
        terms: The matrices A_i and the columns x_i.
        more: The columns y_j.
        target: Target of the result.
        mapped: A matrix that the sum is multiplied with, column by column; its transposed pattern.
        after: Columns that are added to this product.
    """
    widths = [column.size for _, column in terms]
    rows, mask = (size, None) if mapped is None else (len(mapped[1]), mapped[1])
    by = [] if mapped is None else [by_columns(mapped[0], 0, rows)]
    sources = [*chain(*terms), *more, *by, *after]

    def function() -> ca.Function:
        """Return the sum."""
        pairs = [symbols("x", x.size) for x in sources]
        left = iter([value for _, value in pairs])
        total: Any = zeros(rows)
        for width in widths:
            total = total + dot(next(left).reshape(width, rows).T, next(left))
        for _ in more:
            total = total + next(left)
        if mask is not None:
            total = dot(np.where(mask, next(left).reshape(mask.shape), 0.0).T, total)
        for y in left:
            total = total + y
        return ca.Function("columns", [column for column, _ in pairs], [pack(total)])

    if size:
        pattern = None if mask is None else mask.tobytes()
        key = ("columns", tuple(widths), rows, size, len(more), pattern, len(after))
        w.call(w.kernel(key, function, DENSE), copies, sources, [target])


def filled_in(mask: Mask) -> Mask:
    """Return which entries of the factor L of a symmetric matrix are not always zero, shape (n, n).

    Args:
        mask: The same of its entries; an entry that is zero on one side of the diagonal is so on both.
    """
    out = np.tril(mask & mask.T)
    for i in range(len(out)):
        below = i + 1 + np.flatnonzero(out[i + 1 :, i])
        out[np.ix_(below, below)] = True
    return np.tril(out, -1)


def factors(mask: Mask, rows: int) -> ca.Function:
    """Return the function of the factors of the first n columns of an (n, rows) matrix.

    They are symmetric positive definite, L diag L^T: L by rows below its diagonal, then the reciprocals of
    diag.

    Args:
        mask: Which entries of these columns are not always zero, shape (n, n). Without inertia a motion has
            zero on the diagonal: its reciprocal is infinite at run time.
    """
    n = len(mask)
    column, W = matrix("W", n, rows)
    found, _ = Definite.of(np.where(mask & mask.T | np.eye(n, dtype=bool), W[:, :n], 0.0))
    return ca.Function("pivot", [column], [pack(found.lower[np.tril_indices(n, -1)], found.inverses)])


def solved(numbers: Expression, mask: Mask, b: Expression) -> Expression:
    """Return x of W x = -b from the factors of W, of which `mask` tells the entries that are not zero."""
    n, below = len(b), len(b) * (len(b) - 1) // 2
    L = zeros(n, n)
    L[np.tril_indices(n, -1)] = numbers[:below]
    return Definite(np.where(filled_in(mask), L, 0.0), numbers[below:]).solve(-b[:, None])[:, 0]
