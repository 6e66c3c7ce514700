"""How all joints of connected modules follow their motors: q, v and a over the motors' motion.

Along motions that keep the loops closed q, v and a are functions of the motors' m, m_dot and m_ddot. With
a = Psi u_dot + a_0(q, v), and the rows of the motors marked m,

    B = Psi_m^T,   E = dq/dm:  B E^T = Psi^T
    T = a_v E - E (a_v E)_m        da/dm_dot
    D = (T + [v, E]) / 2           dv/dm: a_0 is quadratic in v; [,] of joints with several freedoms
    S = s - E s_m                  da/dm, with the change s of a along (E, D) at fixed u_dot
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from ....errors import SingularityError
from ....linkage.joints import NV
from ....spatial import Index
from ...equations.expressions import Expression, cross, dot, pack, symbols
from ...equations.guards import squares
from ...equations.motor_pivots import motor_pivots
from ...equations.static_elimination import TRUSTED_PIVOT, Pivots
from ...program import Constants, Each, Own, Shared, Source, Turned, Worst
from ..direct import DirectCalls
from ..writer import Writer
from .adjoints import PART
from .columns import ONE, Coordinates, coordinates_of_freedoms, from_freedoms
from .dense import matrix
from .motion import Motions
from .nodes import numbers_of
from .tangents import Graph, Tangents

#: A block of changes, one lane for each motor.
Block = Own | Constants | Turned


@dataclass(frozen=True)
class Factors:
    """Triangular factors of a module's motor map B, in the order of its pivots.

    Attributes:
        pivots: Rows and columns of the pivots.
        numbers: The factors, and the reciprocals of the pivots in their diagonal, row by row.
    """

    pivots: Pivots
    numbers: Shared

    def solve(self, numbers: Expression, b: Expression) -> Expression:
        """Return x of B x = b."""
        n, rows, cols = len(b), self.pivots.rows, self.pivots.cols
        LU, y = numbers.reshape(n, n), b[list(rows)].copy()
        for i in range(1, n):
            y[i] = y[i] - dot(LU[i, :i], y[:i])[()]
        for i in reversed(range(n)):
            rest = dot(LU[i, i + 1 :], y[i + 1 :])[()] if i + 1 < n else 0.0
            y[i] = (y[i] - rest) * LU[i, i]
        x = np.zeros(n).astype(object)
        x[list(cols)] = y
        return x


@dataclass(frozen=True, eq=False)
class MotorMotion:
    """Motion of some modules of a group over their motors.

    Attributes:
        motors: Their indices in tau.
        at: Coordinates of the modules.
        rest: Indices in the robot's v of their freedoms without a motor.
        left: Places of the forces left along the modules' own motions among those of the group.
        factors: Factors of the motor map; None where each joint has a motor: those forces are the motors'.
        over: Changes of "q" (of coordinates), "v" and "a" that motor positions "q", rates "v" and
            accelerations "a" cause; what does not change is left out. Changes of "v" and "a" that others than
            they themselves cause are those of `rest`: the motors' own do not change.
    """

    motors: Index
    at: Coordinates
    rest: Index
    left: Index
    factors: Factors | None
    over: dict[str, dict[str, Block]]


class MotorMotions:
    """Add the motions of modules over their motors to a program."""

    def __init__(self, writer: Writer, motions: Motions) -> None:
        self._w, self._motions = writer, motions
        self._pivots: dict[Any, Pivots] = {}

    def of(self, modules: list[DirectCalls]) -> list[MotorMotion]:
        """Add the motions of a group: those of all modules without loops, and of each other that can move."""
        free = [calls for calls in modules if calls.module.mobility == len(calls.module.v_index)]
        first, at = 0, {}
        for calls in modules:
            at[calls.k] = np.arange(first, first + calls.module.mobility)
            first += calls.module.mobility
        out = [self._free(free, np.concatenate([at[calls.k] for calls in free]))] if free else []
        closed = [calls for calls in modules if calls not in free and calls.module.mobility]
        return out + [self._closed(calls, at[calls.k]) for calls in closed]

    def _free(self, modules: list[DirectCalls], left: Index) -> MotorMotion:
        """Return the motion of modules each of whose joints has a motor."""
        robot = modules[0].request.robot
        freedoms = [int(k) for calls in modules for k in calls.module.v_index[calls.written.joints]]
        motor_at = {int(robot.motor_v[m]): int(m) for x in modules for m in x.module.motor_index}
        motors = np.array([motor_at[k] for k in freedoms])
        at = coordinates_of_freedoms(robot, set(freedoms))
        units = Constants(np.array([[float(k == x) for k in at.v] for x in freedoms]))
        q = self._coordinates(at, units, len(motors))
        over: dict[str, dict[str, Block]] = {"q": {"q": q}, "v": {"v": units}, "a": {"a": units}}
        return MotorMotion(motors, at, at.v[:0], left, None, over)

    def _closed(self, calls: DirectCalls, left: Index) -> MotorMotion:
        """Add the motion of a module with loops."""
        w, robot, n = self._w, calls.request.robot, calls.module.mobility
        at = coordinates_of_freedoms(robot, set(calls.module.v_index.tolist()))
        motors = calls.module.motor_index
        rows = [at.v.tolist().index(k) for k in robot.motor_v[motors]]
        rest = [k for k in range(len(at.v)) if k not in rows]
        assert calls.u_dot is not None
        nodes = self._motions.nodes([calls])
        q, v = w.from_given("q", at.q), w.from_given("v", at.v)
        a = self._motions.accelerations(at.v)
        graph = Graph.between(nodes, [q, v, calls.u_dot], [a])
        known = self._motions.known

        numbers = numbers_of(a, 0)
        motors_last = [numbers[k] for k in [*rest, *rows]]

        def swept(seeds: list[tuple[Source, Block]]) -> Tangents:
            """Add the change of accelerations."""
            tangents = Tangents(w, n, known)
            for source, block in seeds:
                tangents.seed(source, block)
            tangents.sweep(graph)
            return tangents

        def gathered(tangents: Tangents) -> Own:
            """Add the changes one after the other, those of motors last."""
            out = w.own(n, len(at.v))
            tangents.gather(motors_last, [out])
            return out

        over_u, Psi_m = swept([(calls.u_dot, Constants(np.eye(n)))]), w.each(n, n)
        Psi = gathered(over_u)
        over_u.gather([numbers[k] for k in rows], [Psi_m])
        factors = self._factored(calls, Psi_m)
        along, E = self._along(factors, Psi, rows, rest)
        steps = self._coordinates(at, along, n)
        T = self._held(gathered(swept([(v, along)])), E)
        D = self._rates(at, rest, T, along)
        turned = gathered(swept([(q, steps), (w.from_given("v", at.v[rest]), D)]))
        over: dict[str, dict[str, Block]] = {
            "q": {"q": steps, "v": D, "a": self._held(turned, E)},
            "v": {"v": along, "a": T},
            "a": {"a": along},
        }
        return MotorMotion(motors, at, at.v[rest], left, factors, over)

    def _along(self, factors: Factors, Psi: Own, rows: list[int], rest: list[int]) -> tuple[Own, Each]:
        """Add E, one column in each lane, and its rows of joints without a motor for all lanes."""
        w, n = self._w, len(rows)
        solved, E = w.own(len(rest), n), w.each(len(rest), n)
        self._solve(factors, len(rest), Turned(Psi.start, Psi.size, n), [solved, E])

        def function() -> ca.Function:
            """Return one column, whose rows of motors are those of the identity."""
            (first, x), (second, unit) = symbols("x", len(rest)), symbols("unit", n)
            whole = np.zeros(n + len(rest)).astype(object)
            whole[rest], whole[rows] = x, unit
            return ca.Function("along", [first, second], [pack(whole)])

        along = w.own(n, n + len(rest))
        kernel = w.kernel(("along", tuple(rows), len(rest)), function, PART)
        w.call(kernel, n, [Turned(solved.start, n, len(rest)), Constants(np.eye(n))], [along])
        return along, E

    def _coordinates(self, at: Coordinates, along: Block, count: int) -> Block:
        """Return changes of coordinates from those along freedoms."""
        if all(kind in ONE for kind in at.kinds):
            return along
        w = self._w

        def function() -> ca.Function:
            """Return the change of coordinates of one column."""
            (column, x), (moved, given) = symbols("q", len(at.q)), symbols("v", len(at.v))
            return ca.Function("coordinates", [column, moved], [pack(from_freedoms(at.kinds, x, given))])

        out = w.own(count, len(at.q))
        kernel = w.kernel(("coordinates", at.kinds), function, PART)
        w.call(kernel, count, [w.from_given("q", np.tile(at.q, (count, 1))), along], [out])
        return out

    def _factored(self, calls: DirectCalls, Psi_m: Each) -> Factors:
        """Add the factors of the motor map, B = Psi_m^T."""
        n, key = calls.module.mobility, id(calls.request.constant_plans[calls.k])
        if key not in self._pivots:
            request, module = calls.request, calls.module
            plan = request.constant_plans[calls.k]
            found = motor_pivots(plan, request.positions(module), tuple(module.motor_columns.tolist()))
            if found is None:
                raise SingularityError(
                    f"module '{module.name}': its motors do not determine its motion at any posture, so "
                    "there are no derivatives over motors",
                    module=module.name, what="motor map", condition=np.inf,
                )  # fmt: skip
            self._pivots[key] = found
        pivots = self._pivots[key]
        factors = Factors(pivots, self._w.shared(n * n))
        kernel = self._w.kernel(("motor map", pivots), lambda: _factor(n, pivots), PART)
        self._w.call(kernel, 1, [Shared(Psi_m.start, n * n)], [factors.numbers, Worst()])
        return factors

    def _solve(self, factors: Factors, count: int, right: Source, targets: list[Any]) -> None:
        """Add the call that solves B x = b for many columns."""
        n = len(factors.pivots.rows)

        def function() -> ca.Function:
            """Return one column."""
            (given, b), (column, numbers) = symbols("b", n), symbols("LU", n * n)
            return ca.Function("solve", [given, column], [pack(factors.solve(numbers, b))] * len(targets))

        kernel = self._w.kernel(("motor columns", factors.pivots, len(targets)), function, PART)
        self._w.call(kernel, count, [right, factors.numbers], targets)

    def _held(self, changed: Own, E: Each) -> Own:
        """Add the changes of accelerations less what keeps those of the motors, x - E x_m."""
        w, n = self._w, E.size
        size = changed.size - n

        def function() -> ca.Function:
            """Return one column."""
            (column, x), (kept, entries) = symbols("x", changed.size), matrix("E", size, n)
            return ca.Function("held", [column, kept], [pack(x[:size] - dot(entries, x[size:]))])

        out = w.own(n, size)
        kernel = w.kernel(("held", changed.size, n), function, PART)
        w.call(kernel, n, [changed, Shared(E.start, size * n)], [out])
        return out

    def _rates(self, at: Coordinates, rest: list[int], T: Own, along: Own) -> Own:
        """Add the change of the rates of joints without a motor, (T + [v, E]) / 2."""
        w, n, size = self._w, len(at.v) - len(rest), len(at.v)
        turning = any(NV[kind] > 1 for kind in at.kinds)

        def function() -> ca.Function:
            """Return the change of the rates of one column."""
            column, x = symbols("T", T.size)
            columns = [column]
            bracket = np.zeros(size).astype(object)
            if turning:
                (first, v), (second, e) = symbols("v", size), symbols("E", size)
                columns += [first, second]
                bracket = _brackets(at.kinds, v, e)
            return ca.Function("rates", columns, [pack((x + bracket[rest]) * 0.5)])

        more: list[Source] = [w.from_given("v", np.tile(at.v, (n, 1))), along] if turning else []
        out = w.own(n, T.size)
        w.call(w.kernel(("rates", at.kinds, tuple(rest)), function, PART), n, [T, *more], [out])
        return out


def _factor(n: int, pivots: Pivots) -> ca.Function:
    """Return the factors of B, whose rows are the columns of Psi_m, and their guard."""
    column, B = matrix("B", n, n)
    W = B[list(pivots.rows)][:, list(pivots.cols)].copy()
    for i in range(n):
        W[i, i] = 1.0 / W[i, i]
        for j in range(i + 1, n):
            W[j, i] = W[j, i] * W[i, i]
            for c in range(i + 1, n):
                W[j, c] = W[j, c] - W[j, i] * W[i, c]
    doubts = np.array([TRUSTED_PIVOT * size * W[i, i] for i, size in enumerate(pivots.sizes)])
    return ca.Function("factors", [column], [pack(W.ravel()), squares(doubts)])


def _brackets(kinds: tuple[str, ...], v: Expression, e: Expression) -> Expression:
    """Return the Lie brackets of rates with a column of E, joint by joint; zero for one freedom."""
    out, at = np.zeros(len(v)).astype(object), 0
    for kind in kinds:
        x, y = v[at : at + NV[kind]], e[at : at + NV[kind]]
        if kind == "spherical":
            out[at : at + 3] = cross(x, y)
        elif kind == "planar":
            out[at] = x[1] * y[2] - x[2] * y[1]
            out[at + 1] = x[2] * y[0] - x[0] * y[2]
        elif kind == "floating":
            out[at : at + 3] = cross(x[3:], y[:3]) + cross(x[:3], y[3:])
            out[at + 3 : at + 6] = cross(x[3:], y[3:])
        at += NV[kind]
    return out
