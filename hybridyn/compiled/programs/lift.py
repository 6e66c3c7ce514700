"""Program of one Newton step onto the assembled postures, and of the rates there.

The coordinates of a module are its independent joints. They are chosen once, such that the pivots of K over
the other joints are large at generic postures. About a posture q_0, with q = move(q_0, xi),

    K_d step = -residual(q)        K_d v_d = -K_i v_i        xi_dot = T(xi)^-1 v

(d: dependent, i: independent freedoms). Modules do not depend on each other, so equal modules are copies.
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from ...spatial import Array
from ...structure.module import Module
from ..equations.displacement import by_joint, displacement_rate, moved_joint
from ..equations.expressions import dot, pack, symbols, zeros
from ..equations.folding import Folding
from ..equations.guards import largest
from ..equations.request import Request
from ..equations.spanning import dependent_pivots, shape_of, spanning_closures
from ..equations.static_elimination import solve
from ..program import Constants, Program
from .writer import Writer

#: Largest rounding of over-determined closures in the robot's file. Above it they can only be met in the
#: least-squares sense, which elimination with pivots cannot do.
LIFT_ROUNDING = 1e-12
#: Outputs of the step for each module.
MEASURES = ("step", "pivot", "residual")


def lift_program(request: Request) -> Program | None:
    """Build the program of the Newton step; return None if the general path must take it.

    Inputs are the posture "q_0", the displacement "xi" from it, and rates "v" of which the independent ones
    are read. Outputs are position "q" and displacement "xi_next" after the step; the closed rates "v_closed"
    and the rate "xi_dot" before it; "independent", 1 for each independent freedom and 0 for the others; and
    `MEASURES` for each module: the size of the step (rad, module lengths), the smallest pivot over its usual
    size, and the largest residual before the step.
    """
    robot = request.robot
    if robot.base == "moving" or any(m.mechanism.rounding > LIFT_ROUNDING for m in robot.modules):
        return None
    shapes: dict[Any, list[int]] = {}
    for k, module in enumerate(robot.modules):
        shapes.setdefault(shape_of(module), []).append(k)
    sizes = [("q_0", robot.nq), ("xi", robot.nv), ("v", robot.nv)]
    results = [("q", robot.nq)]
    results += [(name, robot.nv) for name in ("xi_next", "v_closed", "xi_dot", "independent")]
    results += [(name, len(robot.modules)) for name in MEASURES]
    w = Writer("lift", sizes, results)
    for shape, numbers in shapes.items():
        modules = [robot.modules[k] for k in numbers]
        function, table = _write(modules)
        q, v = (np.array([getattr(m, index) for m in modules]) for index in ("q_index", "v_index"))
        w.call(
            w.kernel(shape, function, "closures"),
            len(modules),
            [w.from_given("q_0", q), w.from_given("xi", v), w.from_given("v", v), Constants(table)],
            [
                w.result("q", q),
                w.result("xi_next", v),
                w.result("v_closed", v),
                w.result("xi_dot", v),
                w.result("independent", v),
                *(w.result(name, np.array(numbers)[:, None]) for name in MEASURES),
            ],
        )
    return w.program()


def _write(modules: list[Module]) -> tuple[ca.Function, Array]:
    """Return the kernel of modules of one shape, and the table of numbers in which they differ."""
    m = modules[0].mechanism
    tree = m.spanning
    (q_col, q_0), (xi_col, xi) = symbols("q_0", tree.nq), symbols("xi", tree.nv)
    v_col, v = symbols("v", tree.nv)
    step, rates, size, pivot, open_by = zeros(tree.nv), v, ca.SX(0.0), ca.SX(1.0), ca.SX(0.0)
    independent = np.ones(tree.nv)
    folding = Folding()
    if m.spanning_closures.rows:
        pivots = dependent_pivots(modules)
        K, residual = spanning_closures(modules, folding, by_joint(tree, moved_joint, q_0, xi, positions=1))
        dependent, rates = list(pivots.cols), v.copy()
        independent[dependent] = rates[dependent] = 0.0
        X, trust = solve(K, np.stack([-residual, -dot(K, rates)], axis=1), pivots)
        pivot = trust.least
        step[dependent], rates[dependent] = X[dependent, 0], X[dependent, 1]
        size = largest(step / m.spanning_col_scale)
        open_by = largest(residual * m.spanning_row_scale)
    outputs = [
        pack(by_joint(tree, moved_joint, q_0, xi + step, positions=1)),
        pack(xi + step),
        pack(rates),
        pack(by_joint(tree, displacement_rate, xi, rates)),
        pack(independent),
        *map(ca.SX, (size, pivot, open_by)),
    ]
    function = ca.Function("lift", [q_col, xi_col, v_col, folding.symbol()], outputs)
    return function, folding.table(len(modules))
