"""Programs of one Newton step: "close", which follows the motors, and "lift", onto the assembled postures.

"close" is for controllers that measure motors only. The independent coordinates are those of the motors and
of joints that no motor moves. From a nearby posture, such as that of the last tick, the program takes one
Newton step for the positions of the other joints and computes their rates and accelerations:

    K_d step = -residual(q)      K_d v_d = -K_i v_i      K_d a_d = -K_i a_i - K_dot v

(d: dependent, i: independent freedoms). In "lift" the coordinates of a module are its independent joints.
They are chosen once, such that the pivots of K over the other joints are large at generic postures. About a
posture q_0, with q = move(q_0, xi), the step and the rates are the same, and xi_dot = T(xi)^-1 v.

Modules do not depend on each other, so equal modules are copies.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import Any

import casadi as ca
import numpy as np

from ...assembly.follow import MOST_TURNING
from ...errors import SingularityError
from ...linkage.tree import Tree
from ...spatial import Array
from ...structure.module import Module
from ...structure.module_spec import ModuleSpec
from ...structure.robot import HybridRobot
from ..equations.arguments import ChosenNumbers
from ..equations.displacement import by_joint, displacement_rate, moved_joint, position_rate
from ..equations.expressions import Expression, Folding, dot, is_zero, pack, symbols, unpack, zeros
from ..equations.guards import GUARD_CLOSED, OTHER_STRUCTURE, largest, trusted
from ..equations.loops import dependent_pivots, shape_of, spanning_closures
from ..equations.request import Request
from ..equations.static_elimination import solve
from ..program import Program, Source, Target, Worst
from .writer import Writer


def close_program(request: Request) -> Program:
    """Build the program that closes a robot's loops.

    Inputs are "near", a posture with the motors' present positions and the other joints' previous ones, and
    "v" and "a", of which the entries of motors, of a moving base, and of joints that no motor moves are read.
    Outputs are "q", the posture after a Newton step from "near", and the rates and accelerations of all
    joints at "near". The guard is at most 1 if the loops were closed before the step. Otherwise call again
    with "q".
    """
    return following_program(request, "close", freedoms_of(request.robot, request.robot.motors))


def freedoms_of(robot: HybridRobot, joints: Iterable[str]) -> set[int]:
    """Return the entries of v of joints with one freedom."""
    return {robot.v_slices[robot.joint_index[name]].start for name in joints}


def following_program(request: Request, name: str, driven: set[int]) -> Program:
    """Build the program in which all joints follow the freedoms `driven`, with the arrays of "close"."""
    robot = request.robot
    inputs = [("near", robot.nq), ("v", robot.nv), ("a", robot.nv), *request.parameter_inputs]
    w = Writer(name, inputs, [("q", robot.nq), ("v_closed", robot.nv), ("a_closed", robot.nv)])
    if robot.base == "moving":
        keep_base(w)
    ends = {"near": Q, "v": V, "a": V}, {"q": Q, "v_closed": V, "a_closed": V}
    _add_modules(w, request, driven, partial(by_motors, closed=GUARD_CLOSED[request.dtype]), *ends)
    return w.program()


def turning_program(request: Request, driven: set[int]) -> Program:
    """Build the program that compares the loops at two postures, of which the freedoms `driven` are given.

    Inputs are "near" and "q"; there are no outputs. The guard is the largest sum of a row of
    |K_d^-1 (K_d' - K_d)|, K_d' at "q", without units, over `assembly.follow.MOST_TURNING`. Postures on two
    sides of a fold have a guard above 1.

    Raises:
        SingularityError: The freedoms depend on each other.
    """
    robot = request.robot
    w = Writer("turning", [("near", robot.nq), ("q", robot.nq), *request.parameter_inputs], [])
    _add_modules(w, request, driven, _turning, {"near": Q, "q": Q}, {})
    return w.program()


#: What a module's entries of an array are: coordinates, freedoms, or the one of its number.
Q, V, NUMBER = "q_index", "v_index", "number"


def _add_modules(
    w: Writer,
    request: Request,
    driven: set[int],
    write: Callable[..., tuple[ca.Function, Array]],
    inputs: Mapping[str, str],
    outputs: Mapping[str, str],
) -> None:
    """Add the calls of the kernels of all modules.

    Args:
        write: Writes the kernel of modules of one shape, and the table of their numbers.
        inputs: `Q` or `V`, by the name of the input.
        outputs: `Q`, `V` or `NUMBER`, by the name of the output; a further one is a guard.
    """
    robot, shapes = request.robot, dict[Any, list[int]]()
    chosen = request.arguments if isinstance(request.arguments, ChosenNumbers) else None
    for k, module in enumerate(robot.modules):
        shapes.setdefault(shape_of(module, motor_freedoms(module, driven)), []).append(k)
    for shape, numbers in shapes.items():
        modules, own = [robot.modules[k] for k in numbers], chosen.of_modules if chosen else ()
        pairs = [(m, own[k]) for m, k in zip(modules, numbers, strict=True)] if chosen else []
        specs = [m.mechanism.spec if given is None else given.spec for m, given in pairs]
        function, table = write(modules, motor_freedoms(modules[0], driven), specs=specs)
        places = {index: np.array([getattr(m, index) for m in modules]) for index in (Q, V)}
        places[NUMBER] = np.array(numbers)[:, None]
        sources: list[Source] = [w.from_given(name, places[index]) for name, index in inputs.items()]
        sources.append(w.numbers(table, None if chosen is None else chosen.column))
        targets: list[Target] = [w.result(name, places[index]) for name, index in outputs.items()]
        targets += [Worst()] * (function.n_out() - len(targets))
        w.call(w.kernel(shape, function, "closures"), len(modules), sources, targets)


def keep_base(w: Writer) -> None:
    """Copy the prescribed motion of a moving base to the outputs."""
    columns = [ca.SX.sym("base", size) for size in (7, 6, 6)]
    kernel = w.kernel("base", ca.Function("base", columns, columns), "closures")
    pairs = (("near", "q", 7), ("v", "v_closed", 6), ("a", "a_closed", 6))
    sources: list[Source] = [w.from_given(name, np.arange(size)) for name, _, size in pairs]
    targets: list[Target] = [w.result(name, np.arange(size)) for _, name, size in pairs]
    w.call(kernel, 1, sources, targets)


def motor_freedoms(module: Module, driven: set[int]) -> tuple[int, ...]:
    """Return the freedoms of a module's spanning tree that have motors."""
    return tuple(k for k, column in enumerate(module.v_index.tolist()) if column in driven)


def by_motors(
    modules: list[Module], motors: tuple[int, ...], closed: float, specs: Sequence[ModuleSpec] = ()
) -> tuple[ca.Function, Array]:
    """Return the closing kernel of modules of one shape, and the table of numbers in which they differ.

    Args:
        motors: Freedoms of their motors.
        closed: Largest step of closed loops.
        specs: The modules' numbers where some are arguments. The guard includes the rows without a pivot,
            which may depend on the others no longer, or not on this branch.
    """
    m, folding = modules[0].mechanism, Folding()
    tree = m.spanning
    (q_col, q), (v_col, v), (a_col, a) = symbols("q", tree.nq), symbols("v", tree.nv), symbols("a", tree.nv)
    step, guard = zeros(tree.nv), ca.SX(0.0)
    if m.spanning_closures.rows:
        pivots = dependent_pivots(modules, motors)
        dependent = list(pivots.cols)
        K, residual = spanning_closures(modules, folding, q, specs)
        v, a = v.copy(), a.copy()
        v[dependent] = a[dependent] = 0.0
        solved, trust = solve(K, np.stack([-residual, -dot(K, v)], axis=1), pivots)
        step[dependent], v[dependent] = solved[dependent, 0], solved[dependent, 1]
        drift = _drift(K, q_col, v, tree)
        a[dependent] = solve(K, (-dot(K, a) - drift)[:, None], pivots)[0][dependent, 0]
        guard = ca.fmax(trusted(trust), largest(step / m.spanning_col_scale) / closed)
        if specs or len(K) > len(pivots.rows):
            scale, unit = m.spanning_row_scale, m.spanning_col_scale
            speed = largest(v / unit)
            guard = ca.fmax(guard, largest(residual * scale) / closed)
            held = largest(dot(K, v) * scale) <= closed * speed
            guard = ca.fmax(guard, ca.if_else(held, 0.0, OTHER_STRUCTURE))
    moved = by_joint(tree, moved_joint, q, step, positions=1)
    outputs = [pack(moved), pack(v), pack(a), ca.SX(guard)]
    return ca.Function("close", [q_col, v_col, a_col, folding.symbol()], outputs), folding.table(len(modules))


def _turning(
    modules: list[Module], motors: tuple[int, ...], specs: Sequence[ModuleSpec]
) -> tuple[ca.Function, Array]:
    """Return the kernel that compares two postures of modules, see `turning_program` and `by_motors`."""
    m, folding, turned = modules[0].mechanism, Folding(), ca.SX(0.0)
    (near_col, near), (q_col, q) = (symbols(name, m.spanning.nq) for name in ("near", "q"))
    if m.spanning_closures.rows:
        pivots = dependent_pivots(modules, motors)
        dependent = list(pivots.cols)
        if set(dependent) & set(motors):
            why = "its motors depend on each other: their positions contradict each other but by chance"
            raise SingularityError(f"module '{modules[0].name}': {why}", module=modules[0].name)
        unit = m.spanning_col_scale[dependent]
        K, K_there = (spanning_closures(modules, folding, x, specs)[0] for x in (near, q))
        change, _ = solve(K, (K_there - K)[:, dependent] * unit, pivots)
        for row in change[dependent, : len(dependent)] / unit[:, None]:
            turned = ca.fmax(turned, sum(ca.fabs(x) for x in row if not is_zero(x)))
    inputs = [near_col, q_col, folding.symbol()]
    return ca.Function("turning", inputs, [turned / MOST_TURNING]), folding.table(len(modules))


def _drift(K: Expression, q: ca.SX, v: Expression, tree: Tree) -> Expression:
    """Compute K_dot v, shape (rows,)."""
    w_col, w = symbols("w", len(v))
    rate = by_joint(tree, position_rate, unpack(q), w, positions=1)
    drift = ca.jtimes(pack(dot(K, w)), q, pack(rate))
    return unpack(ca.substitute(drift, w_col, pack(v)))


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
    outputs = {"q": Q} | dict.fromkeys(("xi_next", "v_closed", "xi_dot", "independent"), V)
    outputs |= dict.fromkeys(MEASURES, NUMBER)
    sizes = {Q: robot.nq, V: robot.nv, NUMBER: len(robot.modules)}
    inputs = {"q_0": Q, "xi": V, "v": V}
    given, results = ([(name, sizes[index]) for name, index in of.items()] for of in (inputs, outputs))
    w = Writer("lift", given, results)
    _add_modules(w, request, set(), _lift, inputs, outputs)
    return w.program()


def _lift(
    modules: list[Module], motors: tuple[int, ...], specs: Sequence[ModuleSpec]
) -> tuple[ca.Function, Array]:
    """Return the kernel of modules of one shape, and the table of numbers in which they differ."""
    m = modules[0].mechanism
    tree = m.spanning
    (q_col, q_0), (xi_col, xi) = symbols("q_0", tree.nq), symbols("xi", tree.nv)
    v_col, v = symbols("v", tree.nv)
    step, rates, size, pivot, open_by = zeros(tree.nv), v, ca.SX(0.0), ca.SX(1.0), ca.SX(0.0)
    independent = np.ones(tree.nv)
    folding = Folding()
    if m.spanning_closures.rows:
        pivots = dependent_pivots(modules, motors)
        K, residual = spanning_closures(
            modules, folding, by_joint(tree, moved_joint, q_0, xi, positions=1), specs
        )
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
