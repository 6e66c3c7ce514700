"""One Newton step onto the assembled postures, and the rates there, as a program.

The coordinates of a module are those of its joints that the closures leave independent: chosen once, where
the pivots of K over the others are large at generic postures. About a posture q_0, with q = move(q_0, xi),

    K_d step = -residual(q)        K_d v_d = -K_i v_i        xi_dot = T(xi)^-1 v

(d: dependent, i: independent freedoms). All modules stand for themselves, so that equal ones are copies.
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from ..module import Module
from ..spatial import Array
from .chains import sweep
from .choices import Request
from .displacement import displacement_rate, moved_joint
from .expressions import Expression, dot, pack, symbols, zeros
from .folding import Folding
from .guards import largest
from .legs import fold_links
from .links import links_of
from .program import Constants, Program
from .residuals import SpanningRows, coupling_row
from .slots import Writer
from .states import generic_positions
from .static_elimination import Pivots, choose_pivots, solve

#: Over-determined closures that their file rounds by more than this are met in the least-squares sense only,
#: which pivots cannot do.
ROUNDING = 1e-12
#: Smaller pivots would keep the rows sparser, and steps in time less exact: by 50 times at 0.1, by 3 here, of
#: what charts of the tangent space give.
SPARSE = 0.5
#: What the step says of each module.
MEASURES = ("step", "pivot", "residual")


def lift_program(request: Request) -> Program | None:
    """Write the step onto the assembled postures; None where that is left to the general path.

    Inputs are the posture "q_0", the displacement "xi" from it, and rates "v" of which the independent ones
    are read. Outputs are position "q" and displacement "xi_next" after the step, the closed rates "v_closed"
    and the rate "xi_dot" before it, 1 for each "independent" freedom and 0 for the others, and `MEASURES` for
    each module: how far the step went (rad, module lengths), the least pivot over its usual size, the worst
    residual before the step.
    """
    robot = request.robot
    if robot.base == "moving" or any(m.mechanism.rounding > ROUNDING for m in robot.modules):
        return None
    shapes: dict[Any, list[int]] = {}
    for k, module in enumerate(robot.modules):
        shapes.setdefault(_shape(module), []).append(k)
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


def _shape(module: Module) -> Any:
    """Give what modules must share to be written once."""
    spec = module.mechanism.spec
    if not module.mechanism.spanning_closures.rows:
        return tuple(joint.kind for joint in spec.spanning)
    joints = tuple((j.kind, j.parent, tuple(j.axis.tolist())) for j in spec.spanning)
    closures = tuple((c.body_a, c.body_b, c.translations, c.rotation) for c in spec.closures)
    couplings = tuple(c.terms for c in spec.couplings)
    return joints, closures, couplings, module.mobility, module.mechanism.length


def _write(modules: list[Module]) -> tuple[ca.Function, Array]:
    """Write the step of modules of one shape, and the numbers in which they differ."""
    m = modules[0].mechanism
    tree = m.spanning
    (q_col, q_0), (xi_col, xi) = symbols("q_0", tree.nq), symbols("xi", tree.nv)
    v_col, v = symbols("v", tree.nv)
    kinds = [joint.kind for joint in tree.joints]

    def move(displacement: Expression) -> list[Expression]:
        return [
            moved_joint(kind, q_0[at], displacement[to])
            for kind, at, to in zip(kinds, tree.q_slices, tree.v_slices, strict=True)
        ]

    step, rates, size, pivot, open_by = zeros(tree.nv), v, ca.SX(0.0), ca.SX(1.0), ca.SX(0.0)
    independent = np.ones(tree.nv)
    folding = Folding()
    if m.spanning_closures.rows:
        pivots = _pivots(modules)
        K, residual = _closures(modules, folding, move(xi))
        independent[list(pivots.cols)] = 0.0
        known = v.copy()
        known[list(pivots.cols)] = 0.0
        right = np.stack([-residual, -dot(K, known)], axis=1)
        X, pivot = solve(K, right, pivots)
        dependent = list(pivots.cols)
        step[dependent], rates = X[dependent, 0], known
        rates[dependent] = X[dependent, 1]
        size = largest(step / m.spanning_col_scale)
        open_by = largest(residual * m.spanning_row_scale)
    rate = [displacement_rate(kind, xi[to], rates[to]) for kind, to in zip(kinds, tree.v_slices, strict=True)]
    outputs = [
        pack(*move(xi + step)),
        pack(xi + step),
        pack(rates),
        pack(*rate),
        pack(independent),
        *map(ca.SX, (size, pivot, open_by)),
    ]
    function = ca.Function("lift", [q_col, xi_col, v_col, folding.symbol()], outputs)
    return function, folding.table(len(modules))


def _closures(
    modules: list[Module], folding: Folding, positions: list[Expression]
) -> tuple[Expression, Expression]:
    """Give rows and residuals of all closures, shapes (rows, nv) and (rows,); modules differ in `folding`."""
    specs = [module.mechanism.spec for module in modules]
    links = fold_links(folding, [links_of(s.spanning, [np.zeros(10)] * len(s.spanning)) for s in specs])
    nv = sum(link.nv for link in links)
    chain = sweep(links, np.concatenate(positions), zeros(nv), zeros(6))
    rows = SpanningRows(chain)
    residual, K = [zeros(0)], [zeros(0, nv)]
    for same in zip(*(s.closures for s in specs), strict=True):
        frames = [folding.array([getattr(c, name) for c in same]) for name in ("R_a", "p_a", "R_b", "p_b")]
        off, over = rows.closure(same[0], (frames[0], frames[1], frames[2], frames[3]))
        residual, K = [*residual, off], [*K, over]
    for coupled in zip(*(s.couplings for s in specs), strict=True):
        offset = folding.array([np.array([c.offset]) for c in coupled])[0]
        miss, row = coupling_row(chain, coupled[0], positions, offset)
        residual, K = [*residual, np.array([miss], dtype=object)], [*K, row[None]]
    return np.concatenate(K), np.concatenate(residual)


def _pivots(modules: list[Module]) -> Pivots:
    """Choose dependent coordinates that are good at generic postures of all modules of a shape."""
    m, folding = modules[0].mechanism, Folding()
    q_col, q = symbols("q", m.spanning.nq)
    K, _ = _closures(modules, folding, [q[at] for at in m.spanning.q_slices])
    function = ca.Function("K", [q_col, folding.symbol()], [pack(K)])
    table = folding.table(len(modules))
    samples = [
        np.array(function(posture, numbers)).reshape(K.shape)
        for module, numbers in zip(modules, table, strict=True)
        for posture in generic_positions(module)
    ]
    rank = m.spanning.nv - m.mobility
    return choose_pivots(np.array(samples), rank, m.spanning_row_scale, m.spanning_col_scale, SPARSE)
