"""Columns of derivatives over the coordinates of one module: positions in the tangent space."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np

from ....linkage.joints import NQ, NV
from ....spatial import Index
from ....structure.robot import HybridRobot
from ...equations.expressions import Expression, dot, pack, symbols
from ...equations.request import Request
from ...equations.rigid import quaternion_matrix
from ...program import Source, Target
from .adjoints import PART, Adjoints, Parts, Pattern, Reading


@dataclass(frozen=True, eq=False)
class Coordinates:
    """Coordinates of one module, or of a base with a prescribed motion.

    Attributes:
        q: Indices of its coordinates in the robot's q.
        v: Indices of its freedoms in the robot's v.
        kinds: Kinds of its joints, in the order of q and v.
    """

    q: Index
    v: Index
    kinds: tuple[str, ...]


def coordinates_of(robot: HybridRobot) -> list[Coordinates]:
    """Return the coordinates of each module, preceded by those of a base with a prescribed motion."""
    modules = [set(module.v_index.tolist()) for module in robot.modules]
    left = set(range(robot.nv)).difference(*modules)
    return [coordinates_of_freedoms(robot, x) for x in ([left] if left else []) + modules]


def coordinates_of_freedoms(robot: HybridRobot, freedoms: set[int]) -> Coordinates:
    """Return the coordinates of some freedoms."""
    joints = [i for i, at in enumerate(robot.v_slices) if at.start in freedoms]
    q = [k for i in joints for k in range(robot.q_slices[i].start, robot.q_slices[i].stop)]
    v = [k for i in joints for k in range(robot.v_slices[i].start, robot.v_slices[i].stop)]
    return Coordinates(np.array(q, int), np.array(v, int), tuple(robot.kinds[i] for i in joints))


def parameters_of(request: Request) -> list[Index]:
    """Return the indices of each body's ten parameters in the input "parameters", if there is one."""
    count = 0 if request.arguments is None else request.arguments.size
    return [np.arange(first, first + 10) for first in range(0, count, 10)]


def collect(
    adjoints: Adjoints, name: str, index: Index, targets: Sequence[Target], at: Coordinates | None = None
) -> Pattern:
    """Add the call that adds up the adjoints of numbers of a user input.

    Args:
        name: The user input (or computed output).
        index: Indices of the numbers in it.
        targets: Targets of the sums, which all receive the same.
        at: Coordinates whose positions the numbers are: the sums are taken along their freedoms.

    Returns:
        Which sums are not always zero, shape (rows, sums).
    """
    w = adjoints.writer
    read = adjoints.parts(w.from_given(name, index))
    sources: list[Source] = []
    if at is not None and any(kind not in ONE for kind in at.kinds):
        sources = [w.from_given(name, np.tile(index, (adjoints.rows, 1)))]
    kinds = at.kinds if at is not None and sources else ()
    return add_up(adjoints, read, targets, kinds, sources)


def add_up(
    adjoints: Adjoints,
    read: list[Parts],
    targets: Sequence[Target],
    kinds: tuple[str, ...] = (),
    q: Sequence[Source] = (),
) -> Pattern:
    """Add the call that adds up the parts of adjoints; with kinds, along the freedoms of joints at q.

    Returns:
        Which sums are not always zero, shape (rows, sums).
    """
    w, reading = adjoints.writer, Reading.of(read)

    def function() -> ca.Function:
        """Return the sums."""
        blocks, values = reading.symbols()
        columns = list(blocks)
        if kinds:
            column, x = symbols("q", len(read))
            columns, values = [column, *columns], along_freedoms(kinds, x, values)
        return ca.Function("collect", columns, [pack(values)] * len(targets))

    kernel = w.kernel(("collect", reading.key, kinds, len(targets)), function, PART)
    w.call(kernel, adjoints.rows, [*q, *reading.blocks], list(targets))
    return pattern_of(adjoints, read, kinds)


def pattern_of(adjoints: Adjoints, read: list[Parts], kinds: tuple[str, ...] = ()) -> Pattern:
    """Return which sums are not always zero, shape (rows, sums); with kinds, along the freedoms of joints."""
    pattern = np.array([adjoints.pattern(parts) for parts in read], dtype=bool)
    pattern = pattern.reshape(len(read), adjoints.rows)
    if kinds:
        ends = np.cumsum([0, *(NQ[kind] for kind in kinds)]).tolist()
        joints = zip(kinds, pairwise(ends), strict=True)
        rows = [pattern[a:b].any(axis=0) for kind, (a, b) in joints for _ in range(NV[kind])]
        pattern = np.array(rows, dtype=bool).reshape(len(rows), adjoints.rows)
    return pattern.T


#: Kinds of joints with one coordinate, whose rate is the coordinate's.
ONE = ("revolute", "prismatic")


def along_freedoms(kinds: Sequence[str], x: Expression, values: list[Any]) -> list[Any]:
    """Convert derivatives over coordinates to derivatives over freedoms."""
    out: list[Any] = []
    at = 0
    for kind in kinds:
        E = _tangent(kind, x[at:])
        given = np.array(values[at : at + len(E)], dtype=object)
        out += list(dot(E.T, given))
        at += len(E)
    return out


def from_freedoms(kinds: Sequence[str], x: Expression, given: Expression) -> list[Any]:
    """Convert changes along freedoms to changes of coordinates."""
    out: list[Any] = []
    first = 0
    for kind in kinds:
        E = _tangent(kind, x[len(out) :])
        out += list(dot(E, given[first : first + E.shape[1]]))
        first += E.shape[1]
    return out


def _tangent(kind: str, x: Expression) -> Expression:
    """Return the derivatives of a joint's coordinates over its freedoms, shape (nq, nv)."""
    if kind in ONE:
        return np.array([[1.0]], dtype=object)
    if kind == "continuous":
        return np.array([[-x[1]], [x[0]]], dtype=object)
    if kind == "planar":
        c, s = x[2], x[3]
        return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, -s], [0.0, 0.0, c]], dtype=object)
    if kind == "spherical":
        return _quaternion_rates(x)
    E = np.zeros((7, 6), dtype=object) * 1.0
    E[:3, :3], E[3:, 3:] = quaternion_matrix(x[3:7]), _quaternion_rates(x[3:])
    return E


def _quaternion_rates(x: Expression) -> Expression:
    """Return the derivative of a quaternion (x, y, z, w) over a rotation in the body frame, shape (4, 3)."""
    a, b, c, w = (0.5 * x[i] for i in range(4))
    return np.array([[w, -c, b], [c, w, -a], [-b, a, w], [-a, -b, -c]], dtype=object)
