"""Program of the motion of all bodies: one sweep outwards over the spanning tree."""

from __future__ import annotations

from collections.abc import Callable, Container, Sequence
from functools import partial
from typing import Any

import casadi as ca
import numpy as np

from ...linkage.tree import Tree
from ...spatial import Index, cross, rotation_from_quaternion
from ...structure.module import Module
from ...structure.samples import UNIT
from ...symbols import Expression, dot
from ..equations.arguments import ModuleArguments
from ..equations.expressions import eye, pack, symbols, unpack, zeros
from ..equations.request import Request
from ..equations.rigid import links_of
from ..program import Constants, Program, ResultPlace, Shared, Source, Target, Worst
from .general import WIDTH, motion_of, rows_of_motion
from .writer import Writer


def kinematics_program(request: Request) -> Program:
    """Build the program of all bodies' motions; body b of `robot.bodies` begins at WIDTH b of "bodies"."""
    robot = request.robot
    inputs = [("q", robot.nq), ("v", robot.nv), ("a", robot.nv), *request.parameter_inputs]
    w = Writer("kinematics", inputs, [("bodies", WIDTH * len(robot.bodies.bodies))])

    places = [w.result("bodies", WIDTH * body + np.arange(WIDTH)) for body in range(len(robot.bodies.bodies))]
    unit_base(request, w)
    write_motions(request, w, places)
    return w.program()


def unit_base(request: Request, w: Writer) -> None:
    """Add a guard that rejects a non-unit quaternion of a moving or floating base."""
    if request.robot.base == "fixed":
        return
    column, q = symbols("q", 4)
    guard = ca.fabs(sum(x * x for x in q) - 1.0) / UNIT
    kernel = w.kernel("unit", ca.Function("unit", [column], [guard]), "kinematics")
    w.call(kernel, 1, [w.from_given("q", np.arange(3, 7))], [Worst()])


def write_motions(
    request: Request,
    w: Writer,
    places: Sequence[ResultPlace | Shared],
    among: Container[int] | None = None,
    *,
    moved: bool = True,
) -> None:
    """Add the sweep that computes the motion of bodies.

    Args:
        places: Place of each body's `WIDTH` numbers.
        among: Numbers of the modules whose bodies are computed, and those that carry them; by default all.
        moved: Whether accelerations are read; else they count as zero.
    """
    robot = request.robot

    def accelerations(index: Index) -> Source:
        """Return the source of accelerations."""
        return w.from_given("a", index) if moved else Constants(np.zeros((1, len(index))))

    _root(w, robot.base, places[0], accelerations)
    for k, module in list(enumerate(robot.modules))[robot.base == "floating" :]:
        if among is not None and k not in among:
            continue
        own = None if request.arguments is None else request.arguments.of_modules[k]
        key = "bodies", id(module.mechanism), -1 if own is None else k
        targets: list[Target] = [places[robot.body_of_joint[joint]] for joint in module.joints]
        sources: list[Source] = [
            w.from_given("q", module.q_index),
            w.from_given("v", module.v_index),
            accelerations(module.v_index),
            places[robot.bodies.place[module.base][0]],
        ]
        if own is not None:
            sources.append(w.from_given("parameters", own.index))
        w.call(w.kernel(key, partial(_module, module, own), "kinematics"), 1, sources, targets)


def _root(w: Writer, base: str, root: Any, accelerations: Callable[[Index], Source]) -> None:
    """Add the motion of the root body."""
    if base == "fixed":
        still = ca.Function("root", [], [pack(eye(3), zeros(15))])
        w.call(w.kernel("root body", still, "kinematics"), 1, [], [root])
        return
    (q_col, q), (v_col, v), (a_col, a) = symbols("q", 7), symbols("v", 6), symbols("a", 6)
    function = ca.Function(
        "root", [q_col, v_col, a_col], [_in_world(rotation_from_quaternion(q[3:]), q[:3], v, a)]
    )
    sources = [w.from_given("q", np.arange(7)), w.from_given("v", np.arange(6)), accelerations(np.arange(6))]
    w.call(w.kernel("root body", function, "kinematics"), 1, sources, [root])


def _in_world(R: Expression, p: Expression, V: Expression, A: Expression) -> ca.SX:
    """Compute a body's numbers from its placement, and twist and spatial acceleration in its own frame."""
    v, w = V[:3], V[3:]
    return pack(R, p, dot(R, v), dot(R, w), dot(R, A[:3] + cross(w, v)), dot(R, A[3:]))


def _module(module: Module, own: ModuleArguments | None) -> ca.Function:
    """Return the kernel of a module's bodies."""
    spec = module.mechanism.spec if own is None else own.spec
    tree = Tree([*links_of(spec.spanning).values()])
    columns: list[Any] = [ca.SX.sym("q", tree.nq), ca.SX.sym("v", tree.nv), ca.SX.sym("a", tree.nv)]
    base_col, base = symbols("base", WIDTH)
    at_q, at_v, at_a = (unpack(column)[None] for column in columns)
    bodies = rows_of_motion(motion_of(base[None, None]).then(tree.sweep(at_q, at_v, at_a)))[0]
    outputs = [pack(bodies[body]) for body in range(1, len(tree.joints) + 1)]
    arguments = [] if own is None else [own.column]
    return ca.Function("module", [*columns, base_col, *arguments], outputs)
