"""Program of the derivatives of the inverse model: one row for each motor."""

from __future__ import annotations

import numpy as np

from ....spatial import Index
from ...equations.request import Request
from ...program import Call, Program, Target
from ..inverse import inverse_inputs, write_inverse_sweeps
from ..writer import Writer
from .adjoints import DENSE, Adjoints
from .columns import collect, coordinates_of, parameters_of
from .memory import compacted
from .nodes import Joiner


def inverse_derivatives(request: Request) -> Program:
    """Build the program of tau and its derivatives "d_q", "d_v", "d_a", row by row.

    With parameters as inputs, "d_parameters" is added.
    """
    robot, motors = request.robot, len(request.robot.motors)
    inputs = inverse_inputs(request)
    widths = {name: robot.nv if name == "q" else size for name, size in inputs}
    outputs = [("tau", motors)] + [(f"d_{name}", motors * width) for name, width in widths.items()]
    w = Writer("idm_jacobian", inputs, outputs)
    write_inverse_sweeps(request, w)
    if not motors:
        return compacted(w.program())
    nodes = Joiner(w.kernels, w.handed).nodes(step for step in w.steps if isinstance(step, Call))
    adjoints = Adjoints(w, motors, part=DENSE)
    adjoints.seed(w.result("tau", np.arange(motors)))
    adjoints.sweep(nodes, {("given", k) for k in range(sum(size for _, size in inputs))})

    def block(name: str, columns: Index) -> Target:
        """Return the place of some columns."""
        rows = np.arange(motors)[:, None] * widths[name]
        return w.result(f"d_{name}", rows + columns)

    for at in coordinates_of(robot):
        collect(adjoints, "q", at.q, [block("q", at.v)], at)
        for name in ("v", "a"):
            collect(adjoints, name, at.v, [block(name, at.v)])
    for index in parameters_of(request):
        collect(adjoints, "parameters", index, [block("parameters", index)])
    return compacted(w.program())
