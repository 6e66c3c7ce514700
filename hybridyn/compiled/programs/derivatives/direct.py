"""Program of the derivatives of the direct model, from those of the balance of forces that it solves.

At the solution the remaining forces r(q, v, a, tau) vanish, and in each module a = Psi(q) u_dot + a_0(q, v).
Changes of u_dot and of the base's acceleration are eliminated group by group, as the model itself does it.
Over motors, q and v follow them (`motor_motion`), and results are accelerations of the motors.

Along motions that keep the loops closed this is the derivative of the direct model. Single columns, which
open the loops, may differ from those of its program where a base that moves carries a module with closures in
its core: there the program projects the base's forces by the closures, and r by rigid motion.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ....spatial import Index
from ...equations.request import Request
from ...program import Constants, Program
from ..direct import direct_inputs, write_direct_sweeps
from ..inverse import write_balance
from ..writer import Writer
from .columns import changes_of_coordinates, coordinates_of, coordinates_of_freedoms, parameters_of
from .groups import groups_of
from .memory import compacted
from .motion import Motions
from .motor_legs import sum_legs
from .relations import Relations
from .results import Results, relations_of
from .sweeps import Reading


def direct_derivatives(request: Request, *, motors: bool = False) -> Program:
    """Build the program of a and its derivatives "d_q", "d_v", "d_tau", row by row.

    With a moving base "d_base_acceleration" is added, with parameters as inputs "d_parameters". With motors
    as coordinates the derivatives are those of the motors' accelerations.
    """
    robot, inputs = request.robot, direct_inputs(request)
    rows = len(robot.motors) if motors else robot.nv
    widths = {name: rows if name in ("q", "v") else size for name, size in inputs}
    outputs = [("a", robot.nv)] + [(f"d_{name}", rows * width) for name, width in widths.items()]
    w = Writer("ddm_motor_jacobian" if motors else "ddm_jacobian", inputs, outputs, computed=("a",))
    modules = write_direct_sweeps(request, w, motions=True)
    start = len(w.steps)
    balance = write_balance(request, w)
    steps = sum_legs(w, modules, balance, start)
    groups = [group for group in groups_of(request, balance) if group.mobility or not motors]
    relations = relations_of(w, groups, modules, steps, Motions(w), motors=motors)
    results = Results(w, widths, relations)
    if balance.root is not None:
        results.add_base(balance, coordinates_of(robot)[0])
    for x in relations.values():
        for name, index, reading in x.over_motors() if motors else _over_joints(x):
            results.add(name, index, [results.caused(x, reading, len(index))])
    for index in parameters_of(request):
        given = w.from_given("parameters", index)
        found = {x: x.unit_changes(given) for x in relations.values()}
        causes = [
            results.caused(x, reading, len(index)) for x, reading in found.items() if any(reading.pattern)
        ]
        results.add("parameters", index, causes)
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
