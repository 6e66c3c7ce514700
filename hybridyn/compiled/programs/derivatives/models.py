"""Programs of the derivatives of both models: one row for each motor, or one column for each input.

Those of the direct model follow from the balance of forces that it solves. At the solution the remaining
forces r(q, v, a, tau) vanish, and in each module a = Psi(q) u_dot + a_0(q, v). Changes of u_dot and of the
base's acceleration are eliminated group by group, as the model itself does it. Over motors, q and v follow
them (`motor_motion`), and results are accelerations of the motors.

Along motions that keep the loops closed this is the derivative of the direct model. Single columns, which
open the loops, may differ from those of its program where a base that moves carries a module with closures in
its core: there the program projects the base's forces by the closures, and r by rigid motion.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ....spatial import Index
from ...code.rules import compacted
from ...equations.request import Request
from ...program import Call, Constants, Program, Shared, Target
from ..direct import direct_inputs, write_direct_sweeps
from ..inverse import inverse_inputs, write_balance, write_inverse_sweeps
from ..writer import Writer
from .columns import changes_of_coordinates, collect, coordinates_of, coordinates_of_freedoms
from .motor_motion import Motions
from .relations import JOINED, Relations, groups_of
from .results import Results, relations_of
from .sweeps import DENSE, Graph, Joiner, Reading, Sweep


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
    nodes = Joiner(w.kernels, w.handed).nodes(step for step in w.steps if isinstance(step, Call))
    tau, given = w.result("tau", np.arange(motors)), [w.from_given(x, np.arange(size)) for x, size in inputs]
    adjoints = Sweep(w, motors, part=DENSE)
    adjoints.seed(tau, Constants(np.eye(motors)))
    adjoints.backwards(Graph.between(nodes, given, [tau]))

    def block(name: str, columns: Index) -> Target:
        """Return the place of some columns."""
        rows = np.arange(motors)[:, None] * widths[name]
        return w.result(f"d_{name}", rows + columns)

    for at in coordinates_of(robot):
        columns = at.v if order is None else order[at.v]
        collect(adjoints, "q", at.q, block("q", columns), at)
        for name in ("v", "a"):
            collect(adjoints, name, at.v, block(name, columns))
    return compacted(w.program())


def motor_inverse_derivatives(request: Request) -> Program:
    """Build the program of tau and of "d_q", "d_v", "d_a": its derivatives over the motors' motion."""
    motors = len(request.robot.motors)
    if motors == request.robot.nv <= JOINED:
        return inverse_derivatives(request, order=np.argsort(request.robot.motor_v))
    outputs = [("tau", motors)] + [(f"d_{name}", motors * motors) for name in ("q", "v", "a")]
    w = Writer("idm_motor_jacobian", inverse_inputs(request), outputs, computed=("tau",))
    write_inverse_sweeps(request, w)
    w.results["a"] = sum(size for _, size in outputs)  # no place: no call that writes there is made
    start = len(w.steps)
    modules = write_direct_sweeps(request, w, motions=True)
    efforts = [call for call in w.calls_from(start) if w.kernels[call.kernel].part == "effects"]
    w.steps[start:] = efforts  # which the legs' kernels read; of the rest only derivatives are needed
    balance = write_balance(request, w, motions=True)
    steps = w.calls_from(start)
    instead: dict[Shared, Shared] = {}
    for of, calls in zip(modules, balance, strict=True):
        both = ["u_dot", *(f"{x} {o}" for x in "AV" for o in np.flatnonzero(calls.options.carries))]
        instead |= {of.ports[name]: calls.ports[name] for name in both}
        of.ports["u_dot"] = calls.ports["u_dot"]
    motions = Motions(w, instead)
    for of in modules:
        motions.evaluate(of)
    groups = [group for group in groups_of(request, balance) if group.mobility]
    relations = relations_of(w, groups, modules, steps, motions, motors=True, held=True)
    results = Results(w, dict.fromkeys(("q", "v", "a"), motors), relations)
    for x in relations.values():
        for name, index, reading in x.over_motors():
            results.add(x, name, index, reading)
    return compacted(w.program())


def direct_derivatives(request: Request, *, motors: bool = False) -> Program:
    """Build the program of a and its derivatives "d_q", "d_v", "d_tau", row by row.

    With motors as coordinates the derivatives are those of the motors' accelerations.
    """
    robot, inputs = request.robot, direct_inputs(request)
    rows = len(robot.motors) if motors else robot.nv
    widths = {name: rows if name in ("q", "v") else size for name, size in inputs}
    outputs = [("a", robot.nv)] + [(f"d_{name}", rows * width) for name, width in widths.items()]
    w = Writer("ddm_motor_jacobian" if motors else "ddm_jacobian", inputs, outputs, computed=("a",))
    modules = write_direct_sweeps(request, w, motions=True)
    start = len(w.steps)
    balance = write_balance(request, w)
    steps = w.calls_from(start)
    groups = [group for group in groups_of(request, balance) if group.mobility or not motors]
    relations = relations_of(w, groups, modules, steps, Motions(w), motors=motors)
    results = Results(w, widths, relations)
    for x in relations.values():
        for name, index, reading in x.over_motors() if motors else _over_joints(x):
            results.add(x, name, index, reading)
    return compacted(w.program())


#: Name of an input, the indices of its columns in it, and what reads the changes that they cause.
Columns = Iterator[tuple[str, Index, Reading]]


def _over_joints(x: Relations) -> Columns:
    """Return the columns of a group's joints; those of each of several equal legs are found apart."""
    w, modules = x.writer, x.group.modules
    closed = [calls for calls in modules if calls.module.mobility < len(calls.module.v_index)]
    sets = [
        sorted(set(x.group.at.v.tolist()).difference(*(calls.module.v_index.tolist() for calls in closed)))
    ]
    for calls in closed:
        v_index = calls.module.v_index
        legs = [v_index[leg.v].tolist() for group in calls.groups if len(group) > 1 for leg in group]
        sets += [sorted(set(v_index.tolist()).difference(*legs)), *legs]
    for freedoms in filter(None, sets):
        own = coordinates_of_freedoms(modules[0].request.robot, set(freedoms))
        moved = changes_of_coordinates(w, own, Constants(np.eye(len(own.v))), len(own.v))
        yield "q", own.v, x.reading([(w.from_given("q", own.q), moved)], len(own.v))
        yield "v", own.v, x.unit_changes(w.from_given("v", own.v))
    if len(x.group.motors):
        yield "tau", x.group.motors, x.unit_changes(w.from_given("tau", x.group.motors))
