"""Base of the first modules: fixed, floating, or with a prescribed motion."""

from __future__ import annotations

import casadi as ca
import numpy as np

from ...structure.samples import UNIT
from ..equations.arguments.chosen import ChosenNumbers
from ..equations.arguments.structure_guard import decided_alike
from ..equations.expressions import dot, pack, plain, symbols
from ..equations.request import Request
from ..equations.rigid import classical, quaternion_matrix
from ..program import Source, Target, Worst
from .writer import Writer


def unit_base(request: Request, w: Writer) -> None:
    """Add a guard that rejects a non-unit quaternion of a moving or floating base."""
    if request.robot.base == "fixed":
        return
    column, q = symbols("q", 4)
    guard = ca.fabs(sum(x * x for x in q) - 1.0) / UNIT
    kernel = w.kernel("unit", ca.Function("unit", [column], [guard]), "kinematics")
    w.call(kernel, 1, [w.from_given("q", np.arange(3, 7))], [Worst()])


def same_structure(request: Request, w: Writer) -> None:
    """Add a guard that rejects arguments with which the robot has another structure."""
    if request.arguments is None or not request.arguments.decisions:
        return
    assert isinstance(request.arguments, ChosenNumbers)
    column, guard = request.arguments.column, decided_alike(request.arguments.decisions)
    kernel = w.kernel("structure", ca.Function("structure", [column], [guard]), "parameters")
    w.call(kernel, 1, [w.from_given("parameters", np.arange(request.arguments.size))], [Worst()])


def moving_base(
    request: Request, w: Writer, acceleration: Source, *, report: bool
) -> tuple[Source, Source] | None:
    """Return sources of a moving base's twist and acceleration (see `module_graph.base_motion`), else None.

    Args:
        request: The robot and its effects.
        w: The program under construction.
        acceleration: Source of the base's acceleration.
        report: Whether the base's acceleration is among the results.
    """
    if request.robot.base != "moving":
        return None
    (q_col, q), (v_col, v), (a_col, a) = symbols("q", 4), symbols("v", 6), symbols("a", 6)
    velocity = request.on.velocity is not None
    A = classical(v, a) if velocity else a.copy()
    A[:3] = A[:3] - dot(quaternion_matrix(q).T, plain(request.gravity))
    V = pack(v[3:]) if velocity else v_col
    outputs = [V, pack(A), pack(a)] if report else [V, pack(A)]
    kernel = w.kernel(("root", report), ca.Function("root", [q_col, v_col, a_col], outputs), "kinematics")
    twist, at = w.shared(3 if velocity else 6), w.shared(6)
    targets: list[Target] = [twist, at, w.result("a", np.arange(6))] if report else [twist, at]
    sources: list[Source] = [
        w.from_given("q", np.arange(3, 7)),
        w.from_given("v", np.arange(6)),
        acceleration,
    ]
    w.call(kernel, 1, sources, targets)
    return twist, at
