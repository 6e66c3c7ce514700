"""How the joints of connected modules follow their motions and motors: q and v over the motors' motion.

Along motions that keep the loops closed q, v and a are functions of the motors' m, m_dot and m_ddot. With
a = Psi u_dot + a_0(q, v), and the rows of the motors marked m,

    E = Psi Psi_m^-1           dq/dm, also dv/dm_dot
    T = a_v E - E (a_v E)_m    da/dm_dot
    D = (T + [v, E]) / 2       dv/dm: a_0 is quadratic in v; [,] of joints with several freedoms

Idle motions S, the first of Psi = [S, ...], follow no motor. What is along them is taken out
(`idle.over_motors`),

    D = (T + [v, E] - S share^T [v, E]) / 2
"""

from __future__ import annotations

from itertools import chain

import casadi as ca
import numpy as np

from ....errors import SingularityError
from ....joints.kinds import JointKind
from ....spatial import Mask, cross
from ....symbols import Expression, dot
from ...equations.direct import write_direct
from ...equations.direct_legs import write_direct_legs
from ...equations.expressions import eye, pack, symbols, zeros
from ...equations.guarded_elimination import Pivots, solve
from ...equations.idle.over_motors import IdleOverMotors
from ...equations.motor_balance import motor_pivots
from ...equations.scales import squares
from ...program import Constants, Each, Own, Shared, Source, Worst
from ..module_calls import ModuleCalls, Ports, Stages
from ..writer import Writer
from .columns import by_columns, changes_of_coordinates, collect, coordinates_of_freedoms, matrix
from .nodes import StageNode, nodes_of
from .sweeps import PART, Block, ProgramGraph, Sweep


def motions_at(calls: ModuleCalls, name: str, *, held: bool) -> Shared:
    """Return the port "u_dot" or "Q" of a module, the accelerations or forces left along its motions.

    With held motors the accelerations of idle ones are given, too, and no effort balances the forces on them.
    """
    port, first = calls.ports[name], calls.idle if held else 0
    return Shared(port.start + first, port.size - first)


def motion_nodes(w: Writer, calls: ModuleCalls) -> list[StageNode]:
    """Return the nodes that lead from u_dot of a module to its accelerations, a = Psi u_dot + a_0.

    The motion of platforms, which the legs read, is computed. Equal modules share their code.

    Args:
        w: The program under construction.
        calls: Calls of the module in a balance of forces.
    """
    plan, v_index = calls.request.plans[calls.k], calls.module.v_index
    key = ("motion", id(plan), calls.options)
    written = w.once(key, write_direct, plan, calls.options, motion=calls.written.held)
    stages = Stages(w, key, written.stages, ["motion"] * 4)
    ports = {name: x for name, x in calls.ports.items() if not name.startswith("platform ")}
    for stage in written.stages:
        if "opened" in stage.outputs:  # the loops are closed
            rows = stage.function.numel_out(stage.outputs.index("opened"))
            ports["opened"] = w.start(w.shared(rows), np.zeros(rows))
    stages.call(0, ports)
    stages.call(2, ports)
    start = len(w.steps)
    ports |= {name: w.from_given("a", v_index[own]) for name, own in written.at.items() if name != "tau"}
    for s in range(3):
        stages.call(s, ports)
    for n, group in enumerate(calls.groups):
        of_legs = ("motion of legs", id(plan), n, calls.options)
        code, table = w.once(of_legs, write_direct_legs, plan, n, calls.options, motion=True)
        own: Ports = {name: ports[f"{name} {group[0].platform}"] for name in ("platform", "delta")}
        own |= {"numbers": w.numbers(table, plan.column)} | calls.coordinates(group) | calls.idle_ports(n)
        own["a"] = w.from_given("a", v_index[np.array([leg.v for leg in group])])
        Stages(w, of_legs, code, ["motion"], len(group)).call(0, ports | own)
    stages.call(3, ports)
    made = w.calls_from(start)
    del w.steps[start:]
    return nodes_of(w, made, limit=0.0)


class MotorMotion:
    """Motion of one module with loops, or of several each of whose joints has a motor, over their motors.

    Attributes:
        motors: Indices of the motors in tau, one for each column.
        accelerations: The motors' accelerations.
        idle: Number of idle ones among its motions, which come first.
        Psi: Psi_m, column by column; None where each joint has a motor, and motions are those of the motors.
        inverse: Its inverse, column by column.
        minus_B: Changes of the forces left along the motions over efforts, -Psi_m^T.
        over_v: Changes over the motors' rates.
    """

    def __init__(self, w: Writer, modules: list[ModuleCalls], *, held: bool) -> None:
        """Order the motors; where each joint has one, as the motions are.

        Args:
            w: The program under construction.
            modules: Calls of the modules.
            held: Whether the motors are held, as for `motions_at`.
        """
        robot, v_index = modules[0].request.robot, [calls.module.v_index.tolist() for calls in modules]
        self._w, self._module = w, modules[0]
        self._at = coordinates_of_freedoms(robot, {*chain(*v_index)})
        self._numbers = w.from_given("a", self._at.v).numbers(0)
        freedoms, driven = self._at.v.tolist(), robot.motor_v.tolist()
        self.motors = modules[0].module.motor_index
        if modules[0].module.mobility == len(v_index[0]):
            self.motors = np.array([driven.index(k) for x in modules for k in x.joints.tolist()], dtype=int)
        n = len(self.motors)
        self._rows = [freedoms.index(driven[k]) for k in self.motors]
        plan = modules[0].request.plans[modules[0].k]
        self._idle = IdleOverMotors.of(plan, modules[0].module, freedoms)
        self.idle = 0 if held else modules[0].idle
        self._rest = [k for k in range(len(freedoms)) if k not in self._rows]
        self.accelerations = [self._numbers[k] for k in self._rows]
        self.Psi: Shared | None = None
        self.inverse: Shared | None = None
        self.minus_B: Block = Constants(-np.eye(n))
        self._E: Block = Constants(np.eye(len(freedoms))[self._rows])
        self._D: Own | None = None

    def over_q(self) -> list[tuple[Source, Block]]:
        """Return the changes of positions and rates over the motors' positions."""
        w, at = self._w, self._at
        moved = changes_of_coordinates(w, at, self._E, len(self.motors))
        rates = [(w.from_given("v", at.v[self._rest]), self._D)] if self._D else []
        return [(w.from_given("q", at.q), moved), *rates]

    def close(self, over_u: Sweep, graph: ProgramGraph) -> None:
        """Add how the joints follow, and the changes of accelerations over rates.

        Args:
            over_u: Changes of the accelerations over the motions; idle ones, if any, come first.
            graph: What leads to the accelerations.
        """
        w, n = self._w, len(self.motors)
        if not n:
            return
        E = self._closed(over_u) if self._rest else None
        self.over_v = Sweep(w, n, over_u.known)
        self.over_v.seed(w.from_given("v", self._at.v), self._E)
        self.over_v.through(graph)
        if E:
            self._rates(E, graph)

    def _closed(self, over_u: Sweep) -> Each:
        """Add E of a module with loops, for all lanes column by column."""
        w, n, size, all = self._w, len(self.motors), len(self._at.v), over_u.lanes
        Psi, Psi_m, inverse, minus_B = w.each(all, size), w.each(all, n), w.each(n, n), w.each(n, n)
        collect(over_u, self._numbers, Psi)
        collect(over_u, self.accelerations, Psi_m)
        self.Psi, self.inverse = by_columns(Psi_m, all - n, n), by_columns(inverse, 0, n)
        self.minus_B = minus_B
        pivots = self._pivots()
        kernel = w.kernel(("motor map", pivots), lambda: _inverted(n, pivots), PART)
        w.call(kernel, 1, [self.Psi], [self.inverse, Shared(minus_B.start, n * n), Worst()])

        def function() -> ca.Function:
            """Return one column of E."""
            (first, entries), (second, x) = matrix("Psi", n, size), symbols("x", n)
            return ca.Function("along", [first, second], [pack(dot(entries.T, x))] * 2)

        own, E = w.own(n, size), w.each(n, size)
        kernel = w.kernel(("along", n, size), function, PART)
        w.call(kernel, n, [by_columns(Psi, all - n, n), inverse], [own, E])
        self._E = own
        return E

    def _pivots(self) -> Pivots:
        """Return the pivots of the motor map; equal modules share them."""
        request, module = self._module.request, self._module.module
        plan = request.constant_plans[self._module.k]
        found = motor_pivots(plan, module, tuple(module.motor_columns.tolist()))
        if found is None:
            raise SingularityError(
                f"module '{module.name}': its motors do not determine its motion at any posture, so "
                "there are no derivatives over motors",
                module=module.name, what="motor map", condition=np.inf,
            )  # fmt: skip
        return found

    def _along_idle(self, graph: ProgramGraph) -> tuple[Shared, Mask]:
        """Add S of a module, for all lanes column by column; return it, and which entries may not be zero."""
        w, n, size = self._w, self._module.idle, len(self._at.v)
        S, over_idle = w.each(n, size), Sweep(w, n, self.over_v.known)
        over_idle.seed(self._module.ports["u_dot"].numbers(0)[:n], Constants(np.eye(n)))
        over_idle.through(graph)
        collect(over_idle, self._numbers, S)
        return by_columns(S, 0, n), over_idle.pattern(self._numbers)

    def _rates(self, E: Each, graph: ProgramGraph) -> None:
        """Add D, the change of the rates of joints without a motor."""
        w, n, size, kinds = self._w, len(self.motors), len(self._at.v), self._at.kinds
        rest, rows, reading = self._rest, self._rows, self.over_v.reading(self._numbers)
        idle, turning = self._module.idle, any(kind.nv > 1 for kind in kinds)
        more: list[Source] = [w.from_given("v", np.tile(self._at.v, (n, 1))), self._E] if turning else []
        moves = np.zeros((idle, size), dtype=bool)
        if turning and idle:
            all_S, moves = self._along_idle(graph)
            more.append(all_S)

        def function() -> ca.Function:
            """Return the change of the rates of one column."""
            columns, values = reading.symbols()
            x = np.array(values, dtype=object)
            kept, entries = matrix("E", n, size)
            columns.append(kept)
            T = x[rest] - dot(entries.T[rest], x[rows])
            if turning:
                (first, v), (second, e) = symbols("v", size), symbols("e", size)
                (third, S), bracket = matrix("S", idle, size), brackets(kinds, v, e)
                columns += [first, second, *([third] if idle else [])]
                T = self._idle.taken_out(T + bracket[rest], np.where(moves, S, 0.0), bracket, rest)
            return ca.Function("rates", columns, [pack(T * 0.5)])

        self._D = w.own(n, len(rest))
        key = ("rates", reading.key, kinds, tuple(rows), self._idle.key, moves.tobytes())
        sources = [*reading.blocks, Shared(E.start, size * n), *more]
        w.call(w.kernel(key, function, PART), n, sources, [self._D])


def _inverted(n: int, pivots: Pivots) -> ca.Function:
    """Return the inverse of Psi_m, which is given column by column, and its guard."""
    column, B = matrix("B", n, n)
    inverse, doubts = solve(B, eye(n), pivots)
    return ca.Function("inverted", [column], [pack(inverse.ravel()), pack(-B.T.ravel()), squares(doubts)])


def brackets(kinds: tuple[JointKind, ...], v: Expression, e: Expression) -> Expression:
    """Return the Lie brackets of rates with a column of E, joint by joint; zero for one freedom."""
    out, at = zeros(len(v)), 0
    for kind in kinds:
        own, S = slice(at, at + kind.nv), kind.columns
        at = own.stop
        if not kind.single:
            x, y = zeros(2, 6)
            x[S], y[S] = v[own], e[own]
            linear = cross(x[3:], y[:3]) + cross(x[:3], y[3:])
            out[own] = np.concatenate([linear, cross(x[3:], y[3:])])[S]
    return out
