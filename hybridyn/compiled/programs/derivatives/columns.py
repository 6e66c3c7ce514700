"""Columns of derivatives over the coordinates of one module: positions in the tangent space."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from ....spatial import Index
from ....structure.robot import HybridRobot
from ...equations.expressions import Expression, dot, pack, symbols
from ...equations.request import Request
from ...equations.rigid import quaternion_matrix
from ...program import Source, Target
from ..writer import Writer
from .sweeps import PART, Block, Sweep


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


def collect(sweep: Sweep, name: str, index: Index, target: Target, at: Coordinates | None = None) -> None:
    """Add the call that adds up the adjoints of numbers of a user input.

    Args:
        sweep: The adjoints.
        name: The user input (or computed output).
        index: Indices of the numbers in it.
        target: Target of the sums.
        at: Coordinates whose positions the numbers are: the sums are taken along their freedoms.
    """
    w, reading = sweep.writer, sweep.reading(sweep.writer.from_given(name, index).numbers(0))
    kinds = at.kinds if at is not None and any(kind not in ONE for kind in at.kinds) else ()
    q: list[Source] = [w.from_given(name, np.tile(index, (sweep.lanes, 1)))] if kinds else []

    def function() -> ca.Function:
        """Return the sums."""
        columns, values = reading.symbols()
        if kinds:
            column, x = symbols("q", len(values))
            columns, values = [column, *columns], along_freedoms(kinds, x, values)
        return ca.Function("collect", columns, [pack(values)])

    kernel = w.kernel(("collect", reading.key, kinds), function, PART)
    w.call(kernel, sweep.lanes, [*q, *reading.blocks], [target])


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


def changes_of_coordinates(w: Writer, at: Coordinates, along: Block, count: int) -> Block:
    """Return changes of coordinates from those along freedoms, one column in each lane."""
    if all(kind in ONE for kind in at.kinds):
        return along

    def function() -> ca.Function:
        """Return the change of coordinates of one column."""
        (column, x), (moved, given) = symbols("q", len(at.q)), symbols("v", len(at.v))
        return ca.Function("coordinates", [column, moved], [pack(from_freedoms(at.kinds, x, given))])

    out = w.own(count, len(at.q))
    kernel = w.kernel(("coordinates", at.kinds), function, PART)
    w.call(kernel, count, [w.from_given("q", np.tile(at.q, (count, 1))), along], [out])
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
