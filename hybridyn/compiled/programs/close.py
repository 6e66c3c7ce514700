"""Program that computes the motion of all joints from the motors', for controllers that measure motors only.

The independent coordinates are those of the motors and of joints that no motor moves. From a nearby posture,
such as that of the last tick, the program takes one Newton step for the positions of the other joints and
computes their rates and accelerations:

    K_d step = -residual(q)      K_d v_d = -K_i v_i      K_d a_d = -K_i a_i - K_dot v

(d: dependent, i: independent freedoms).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import casadi as ca
import numpy as np

from ...linkage.tree import Tree
from ...spatial import Array
from ...structure.module import Module
from ...structure.module_spec import ModuleSpec
from ...structure.robot import HybridRobot
from ..equations.arguments.chosen import ChosenNumbers
from ..equations.arguments.structure_guard import OTHER_STRUCTURE
from ..equations.displacement import by_joint, moved_joint, position_rate
from ..equations.expressions import Expression, dot, pack, symbols, unpack, zeros
from ..equations.folding import Folding
from ..equations.guards import GUARD_CLOSED, largest, trusted
from ..equations.request import Request
from ..equations.spanning import dependent_pivots, shape_of, spanning_closures
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
    shapes: dict[Any, list[Module]] = {}
    specs: dict[Any, list[ModuleSpec]] = {}
    chosen = request.arguments if isinstance(request.arguments, ChosenNumbers) else None
    every = [None] * len(robot.modules) if chosen is None else chosen.of_modules
    for module, own in zip(robot.modules, every, strict=True):
        shape = shape_of(module, motor_freedoms(module, driven))
        shapes.setdefault(shape, []).append(module)
        specs.setdefault(shape, []).append(module.mechanism.spec if own is None else own.spec)
    inputs = [("near", robot.nq), ("v", robot.nv), ("a", robot.nv), *request.parameter_inputs]
    w = Writer(name, inputs, [("q", robot.nq), ("v_closed", robot.nv), ("a_closed", robot.nv)])
    if robot.base == "moving":
        keep_base(w)
    for shape, modules in shapes.items():
        motors, closed = motor_freedoms(modules[0], driven), GUARD_CLOSED[request.dtype]
        function, table = by_motors(modules, motors, closed, () if chosen is None else specs[shape])
        q, v = (np.array([getattr(m, index) for m in modules]) for index in ("q_index", "v_index"))
        sources: list[Source] = [
            w.from_given("near", q),
            w.from_given("v", v),
            w.from_given("a", v),
            w.numbers(table, None if chosen is None else chosen.column),
        ]
        targets: list[Target] = [w.result("q", q), w.result("v_closed", v), w.result("a_closed", v), Worst()]
        w.call(w.kernel(shape, function, "closures"), len(modules), sources, targets)
    return w.program()


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


def _drift(K: Expression, q: ca.SX, v: Expression, tree: Tree) -> Expression:
    """Compute K_dot v, shape (rows,)."""
    w_col, w = symbols("w", len(v))
    rate = by_joint(tree, position_rate, unpack(q), w, positions=1)
    drift = ca.jtimes(pack(dot(K, w)), q, pack(rate))
    return unpack(ca.substitute(drift, w_col, pack(v)))
