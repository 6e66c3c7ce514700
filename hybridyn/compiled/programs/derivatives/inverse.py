"""Program of the derivatives of the inverse model: one row for each motor."""

from __future__ import annotations

import numpy as np

from ....spatial import Index
from ...equations.request import Request
from ...program import Call, Constants, Program, Shared, Target
from ..direct import write_direct_sweeps
from ..inverse import inverse_inputs, write_balance, write_inverse_sweeps
from ..writer import Writer
from .columns import collect, coordinates_of, parameters_of
from .groups import JOINED, groups_of
from .memory import compacted
from .motion import Motions
from .nodes import Joiner
from .results import Results, relations_of
from .sweeps import DENSE, Graph, Sweep


def inverse_derivatives(request: Request, *, order: Index | None = None) -> Program:
    """Build the program of tau and its derivatives "d_q", "d_v", "d_a", row by row.

    With parameters as inputs, "d_parameters" is added.

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
    for index in parameters_of(request):
        collect(adjoints, "parameters", index, block("parameters", index))
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
    for of, calls in zip(modules, balance.modules, strict=True):
        for old, new in ((of.V, calls.V), (of.A, calls.A)):
            instead |= {old[o]: new[o] for o in old}
        assert of.u_dot is not None
        assert calls.u_dot is not None
        instead[of.u_dot] = of.u_dot = calls.u_dot
    motions = Motions(w, instead)
    for of in modules:
        motions.evaluate(of)
    groups = [group for group in groups_of(request, balance) if group.mobility]
    relations = relations_of(w, groups, modules, steps, motions, motors=True, held=True)
    results = Results(w, dict.fromkeys(("q", "v", "a"), motors), relations)
    for x in relations.values():
        for name, index, reading in x.over_motors():
            results.add(name, index, [results.caused(x, reading, len(index))])
    return compacted(w.program())
