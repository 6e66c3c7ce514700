"""Programs of the derivatives of both models: one row for each motor, or one column for each input.

Those of the direct model follow from the balance of forces that it solves. At the solution the remaining
forces r(q, v, a, tau) vanish, and in each module a = Psi(q) u_dot + a_0(q, v). Changes of u_dot and of the
base's acceleration are eliminated group by group, as the model itself does it. Over motors, q and v follow
them (`motor_motion`), and results are accelerations of the motors.

Along motions that keep the loops closed this is the derivative of the direct model. Single columns, which
open the loops, may differ from those of its program where a base that moves carries a module with closures in
its core: there the program projects the base's forces by the closures, and r by rigid motion.

An input changes the forces and outputs of its own group alone, and through them the wrench on the group's
base and the motion of its outputs. All other groups respond to these, so that only the dense rows that are
asked for grow with the square of the number of modules.

Responses to a unit wrench on an output, and to unit accelerations and twists of it, are matrices for all
lanes, column by column. Those to a wrench beta on an output, which what it carries requires there, are found
outwards from the group of the output: groups inwards of it respond as to the wrench that it passes on.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from ....spatial import Index
from ...code.rules import compacted
from ...equations.idle.over_motors import idle_in_v
from ...equations.request import Request
from ...program import Constants, Own, Program, Shared, Target
from ..direct import direct_inputs, write_direct_sweeps
from ..inverse import inverse_inputs, write_balance, write_inverse_sweeps
from ..writer import Writer
from .columns import (
    Term,
    add_terms,
    by_columns,
    changes_of_coordinates,
    collect,
    coordinates_of,
    coordinates_of_freedoms,
)
from .connected import JOINED, ConnectedModules, groups_of
from .matrix_names import MORE, MOTIONS, WRENCH, MatrixName
from .motor_motion import MotorMotion, motion_nodes
from .nodes import nodes_of
from .relations import Relations
from .responses import Responses, runs_of
from .sweeps import DENSE, ProgramGraph, Reading, Sweep


class Results:
    """Add the derivatives to the results: for each input the columns of each group."""

    def __init__(
        self, w: Writer, widths: dict[str, int], relations: Mapping[ConnectedModules, Relations]
    ) -> None:
        """Prepare the results.

        Args:
            w: The program under construction.
            widths: Number of columns of each input.
            relations: Relations of each group, outwards.
        """
        self._w, self._widths, self._relations = w, widths, relations
        self._responses = Responses(w, relations)

    def add(self, x: Relations, name: str, index: Index, reading: Reading) -> None:
        """Add the columns of an input of a group: what it causes in all groups.

        Args:
            x: Relations of the group.
            name: The input.
            index: Indices of the columns in the user input.
            reading: What reads the changes that the columns cause at given motions.
        """
        w, known, onwards = self._w, self._responses, list[Shared]()
        if x.parts and len(self._relations) == 1:  # nothing responds but its motors
            x.caused(
                reading, len(index), [], w.result(f"d_{name}", x.rows * self._widths[name] + index[:, None])
            )
            return
        if x.group in known.own:
            onwards = [by_columns(known.onwards[place], 0, 6) for place in x.group.children]
        ends = x.caused(reading, len(index), onwards)
        for y in self._relations.values():
            place = w.result(f"d_{name}", y.rows * self._widths[name] + index[:, None])
            terms = self._terms(x.group, ends, y.group) if y.motions else []
            motions = [ends[MOTIONS]] if y is x and y.motions else []
            more = [ends[MORE]] if y is x and MORE in ends else []
            mapped = (y.Psi, y.pattern) if y.pattern is not None and (terms or motions) else None
            add_terms(w, len(index), len(y.rows), terms, motions, place, mapped, more)

    def _terms(
        self, source: ConnectedModules, ends: dict[MatrixName, Own], group: ConnectedModules
    ) -> list[Term]:
        """Return the motions of a group that changes in another, or at its own base, bring about."""
        responses = self._responses
        for k, output in enumerate(source.children):
            if group in responses.to_motion[output]:
                known, V = responses.to_motion[output][group], ends.get(MatrixName("V", k))
                twist = [(by_columns(known, 6, V.size), V)] if V else []
                return [(by_columns(known, 0, 6), ends[MatrixName("A", k)]), *twist]
        if WRENCH not in ends:
            return []
        known_of = responses.own if source is group else responses.to_wrench.get(source.base, {})
        found = known_of.get(group)
        return [(by_columns(found, 0, 6), ends[WRENCH])] if found else []


def inverse_derivatives(request: Request, *, order: Index | None = None) -> Program:
    """Build the program of tau and its derivatives "d_q", "d_v", "d_a", row by row.

    Args:
        request: The robot and its effects.
        order: The motor of each freedom, where each has one and the motors are the coordinates.
    """
    robot, motors = request.robot, len(request.robot.motors)
    inputs = inverse_inputs(request)
    widths = {name: robot.nv if name == "q" else size for name, size in inputs}
    outputs = [("tau", motors)] + [(f"d_{name}", motors * width) for name, width in widths.items()]
    w = Writer("idm_jacobian" if order is None else "idm_motor_jacobian", inputs, outputs)
    write_inverse_sweeps(request, w)
    if not motors:
        return compacted(w.program())
    nodes = nodes_of(w, w.calls_from(0))
    tau, given = w.result("tau", np.arange(motors)), [w.from_given(x, np.arange(size)) for x, size in inputs]
    adjoints = Sweep(w, motors, part=DENSE)
    adjoints.seed(tau, Constants(np.eye(motors)))
    adjoints.through(ProgramGraph.between(nodes, given, [tau]), back=True)

    def block(name: str, columns: Index) -> Target:
        """Return the place of some columns."""
        rows = np.arange(motors)[:, None] * widths[name]
        return w.result(f"d_{name}", rows + columns)

    for at in coordinates_of(robot):
        columns = at.v if order is None else order[at.v]
        collect(adjoints, w.from_given("q", at.q).numbers(0), block("q", columns), at)
        for name in ("v", "a"):
            collect(adjoints, w.from_given(name, at.v).numbers(0), block(name, columns))
    return compacted(w.program())


def motor_inverse_derivatives(request: Request) -> Program:
    """Build the program of tau and of "d_q", "d_v", "d_a": its derivatives over the motors' motion."""
    motors = len(request.robot.motors)
    if motors == request.robot.nv <= JOINED:
        return inverse_derivatives(request, order=np.argsort(request.robot.motor_v))
    outputs = [("tau", motors)] + [(f"d_{name}", motors * motors) for name in ("q", "v", "a")]
    w = Writer("idm_motor_jacobian", inverse_inputs(request), outputs, computed=("tau",))
    write_inverse_sweeps(request, w)
    return _by_groups(request, w, dict.fromkeys(("q", "v", "a"), motors), motors=True, held=True)


def direct_derivatives(request: Request, *, motors: bool = False) -> Program:
    """Build the program of a and its derivatives "d_q", "d_v", "d_tau", row by row.

    With motors as coordinates the derivatives are those of the motors' accelerations.
    """
    robot, inputs = request.robot, direct_inputs(request)
    rows = len(robot.motors) if motors else robot.nv
    widths = {name: rows if name in ("q", "v") else size for name, size in inputs}
    outputs = [("a", robot.nv)] + [(f"d_{name}", rows * width) for name, width in widths.items()]
    w = Writer("ddm_motor_jacobian" if motors else "ddm_jacobian", inputs, outputs, computed=("a",))
    write_direct_sweeps(request, w)
    return _by_groups(request, w, widths, motors=motors, held=False)


def _by_groups(request: Request, w: Writer, widths: dict[str, int], *, motors: bool, held: bool) -> Program:
    """Add the derivatives of the balance of forces, group by group, and return the program.

    Args:
        request: The robot and its effects.
        w: The program under construction, with the model.
        widths: Number of columns of each input.
        motors: Whether the motors are the coordinates.
        held: Whether accelerations are given, as `Relations`.
    """
    start = len(w.steps)
    balance = write_balance(request, w)
    steps = w.calls_from(start)
    motions = {calls.k: motion_nodes(w, calls) for calls in balance}
    given = [w.from_given(name, np.arange(size)) for name, size in w.inputs]
    known: dict[ConnectedModules, Relations] = {}
    for group in reversed(groups_of(request, balance, held=held)):
        if motors and not group.mobility:
            continue
        a, outputs = w.from_given("a", group.at.v), [group.output(place) for place in group.children]
        u_dot = [calls.ports["u_dot"] for calls in group.modules]
        leaves = [w.from_given("q", group.at.q), w.from_given("v", group.at.v), *u_dot]
        moving = [node for calls in group.modules for node in motions[calls.k]]
        own = {id(call) for member in group.modules for call in member.calls}
        inputs = [*given, a, *group.moved(), *(W for *_, W in outputs)]
        nodes = nodes_of(w, (call for call in steps if id(call) in own))
        graphs = ProgramGraph.between(moving, leaves, [a]), ProgramGraph.between(nodes, inputs, group.results)
        runs = runs_of(group.modules)
        parts = [MotorMotion(w, run, held=held) for run in runs] if motors else []
        carried = {place: [known[x].H for x in children] for place, children in group.children.items()}
        known[group] = Relations(w, group, graphs, runs, a, carried, parts)
    relations = dict(reversed(known.items()))
    results = Results(w, widths, relations)
    for x in relations.values():
        for name, index, reading in x.over_motors() if motors else _over_joints(x):
            results.add(x, name, index, reading)
    return compacted(w.program())


#: Name of an input, the indices of its columns in it, and what reads the changes that they cause.
Columns = Iterator[tuple[str, Index, Reading]]


def _over_joints(x: Relations) -> Columns:
    """Return the columns of a group's joints.

    Those of each of several equal legs, and of each joint that may idle, are found apart: they change little.
    In modules of few joints the lanes of one vector hold all.
    """
    w, modules = x.writer, x.group.modules
    closed = [calls for calls in modules if calls.module.mobility < len(calls.module.v_index)]
    sets = [
        sorted(set(x.group.at.v.tolist()).difference(*(calls.module.v_index.tolist() for calls in closed)))
    ]
    for calls in closed:
        v_index = calls.module.v_index
        if len(v_index) <= JOINED:
            sets.append(sorted(v_index.tolist()))
            continue
        legs = [v_index[leg.v].tolist() for group in calls.groups if len(group) > 1 for leg in group]
        idle = idle_in_v(calls.request.plans[calls.k], calls.module)
        rods = [at for at in idle if not any({*at} <= {*leg} for leg in legs)]
        sets += [sorted(set(v_index.tolist()).difference(*legs, *rods)), *legs, *rods]
    for freedoms in filter(None, sets):
        own = coordinates_of_freedoms(modules[0].request.robot, set(freedoms))
        moved = changes_of_coordinates(w, own, Constants(np.eye(len(own.v))), len(own.v))
        yield "q", own.v, x.reading([(w.from_given("q", own.q), moved)], len(own.v))
        yield "v", own.v, x.unit_changes(w.from_given("v", own.v))
    if len(x.group.motors):
        yield "tau", x.group.motors, x.unit_changes(w.from_given("tau", x.group.motors))
