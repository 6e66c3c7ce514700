"""Programs along a path: outputs with their first and second derivatives along it."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import casadi as ca

from ..program import Program, Start
from .activity import ActiveCall, active_steps
from .mirrored import Mirrored
from .simplified import simplified
from .twice import chosen, folded, spread

#: Heading of the kernels in operation counts.
PART = "rates"


def rate_program(program: Program, name: str, over: Sequence[str], zero: Sequence[str] = ()) -> Program:
    """Build the program of all outputs and their derivatives along a path of some inputs.

    The path of the input "v" has the derivatives "v_dot" and "v_ddot", which are inputs, too. Outputs are
    those of the program, with "_dot" and "_ddot" their derivatives.

    Args:
        program: The model.
        name: Name of the new program.
        over: The inputs that change.
        zero: Those among them that are zero at the start of the path.
    """
    w = Mirrored(program, name, 2, over, zero)
    w.rest(1)
    w.rest(2)
    for step in active_steps(program, over, [name for name, _ in program.outputs]):
        if isinstance(step, Start):
            w.steps.append(step)
        else:
            _add(w, program, step)
    return w.program()


def _add(w: Mirrored, program: Program, step: ActiveCall) -> None:
    """Add a call with the derivatives of its numbers."""
    call, function = step.call, program.kernels[step.call.kernel].function
    if not step.matters:
        w.as_it_is(call)
        return
    zero = w.zeros(call)
    key = call.kernel, step.over, step.needed, zero
    of = [x for x, own in zip(call.sources, step.over, strict=True) if own]
    ends = [x for x, own in zip(call.targets, step.needed, strict=True) if own]
    sources = [*(w.at(x) for x in call.sources), *(w.at(x, order) for order in (1, 2) for x in of)]
    targets = [*(w.at(x) for x in call.targets), *(w.at(x, order) for order in (1, 2) for x in ends)]
    at = w.kernel(("rates", key), partial(_along, function, step, zero), PART)
    w.call(at, call.copies, sources, targets)


def _along(function: ca.Function, step: ActiveCall, zero: Sequence[int]) -> ca.Function:
    """Return a kernel's outputs with their two derivatives along a path of its inputs."""
    x, moved, bent = (
        [ca.SX.sym(f"{name}{i}", function.nnz_in(i)) for i in range(function.n_in())] for name in "xde"
    )
    y = [ca.densify(value) for value in simplified(function).call(x)]
    X, X_dot, X_ddot = (chosen(columns, step.over) for columns in (x, moved, bent))
    Y_dot = ca.jtimes(chosen(y, step.needed), X, X_dot)
    Y_ddot = ca.jtimes(Y_dot, ca.vertcat(X, X_dot), ca.vertcat(X_dot, X_ddot))
    inputs = [*x, *(c for columns in (moved, bent) for c, own in zip(columns, step.over, strict=True) if own)]
    outputs = [*y, *(c for Y in (Y_dot, Y_ddot) for c in spread(Y, step.needed, y))]
    return ca.Function("along", inputs, folded(x, zero, outputs))
