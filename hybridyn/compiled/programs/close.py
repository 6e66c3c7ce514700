"""Programs of one Newton step: "close", which follows the motors, and "lift", onto the assembled postures.

"close" is for controllers that measure motors only. The independent coordinates are those of the motors and
of joints that no motor moves. From a nearby posture, such as that of the last tick, the program takes one
Newton step for the positions of the other joints and computes their rates and accelerations (`loops.engine`).
Independent freedoms that only move what is idle, such as the turn of a rod between two balls, are not read.
In "lift" the coordinates of a module are its independent joints.
They are chosen once, such that the pivots of K over the other joints are large at generic postures. About a
posture q_0, with q = move(q_0, xi), the step and the rates are the same, and xi_dot = T(xi)^-1 v.

Modules do not depend on each other, so equal modules are copies.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence, Sized
from functools import reduce

import casadi as ca
import numpy as np

from ...assembly.walk import MOST_TURNING
from ...joints import displacement
from ...spatial import Index
from ...structure.robot import HybridRobot
from ...symbols import dot, is_zero
from ..equations.arguments import OTHER_STRUCTURE, ChosenNumbers
from ..equations.expressions import pack, symbols
from ..equations.guarded_elimination import TRUSTED_PIVOT
from ..equations.request import Request
from ..equations.scales import GUARD_CLOSED, largest, squares
from ..loops.engine import drift
from ..program import Program
from .loop_kernels import Kernel, LoopKernel, loop_kernels
from .writer import ModuleWriter


def close_program(request: Request) -> Program:
    """Build the program that closes a robot's loops.

    Inputs are "near", a posture with the motors' present positions and the other joints' previous ones, and
    "v" and "a", of which the entries of motors, of a moving base, and of joints that no motor moves are read,
    but not those of idle motions. Outputs are "q", the posture after a Newton step from "near", and the rates
    and accelerations of all joints at "near". The guard is at most 1 if the loops were closed before the
    step. Otherwise call again with "q".
    """
    return following_program(request, "close", freedoms_of(request.robot, request.robot.motors))


def freedoms_of(robot: HybridRobot, joints: Iterable[str]) -> set[int]:
    """Return the entries of v of joints with one freedom."""
    return {robot.v_slices[robot.joint_index[name]].start for name in joints}


def following_program(request: Request, name: str, driven: set[int]) -> Program:
    """Build the program in which all joints follow the freedoms `driven`, with the arrays of "close"."""
    w = loop_writer(request, name, {"near": "q", "v": "v", "a": "v"}, CLOSED)
    if request.robot.base == "moving":
        keep_base(w)
    for key, numbers, kernel in loop_kernels(request, driven):
        w.add(key, numbers, by_motors(kernel, GUARD_CLOSED[request.dtype]))
    return w.program()


#: Outputs of programs that close loops.
CLOSED = {"q": "q", "v_closed": "v", "a_closed": "v"}


def turning_program(request: Request, side: Sequence[str]) -> Program:
    """Build the program that compares the loops at two postures, of which joints of one freedom are given.

    Inputs are "near" and "q"; there are no outputs. The guard is the largest sum of a row of
    |K_d^-1 (K_d' - K_d)|, K_d' at "q", without units, over `assembly.walk.MOST_TURNING`. Postures on two
    sides of a fold have a guard above 1.
    """
    w = loop_writer(request, "turning", {"near": "q", "q": "q"}, {})
    for key, numbers, kernel in loop_kernels(request, freedoms_of(request.robot, side)):
        w.add(key, numbers, turning(kernel))
    return w.program()


def loop_writer(
    request: Request,
    name: str,
    inputs: dict[str, str],
    outputs: dict[str, str],
    **more: tuple[int, list[Index]],
) -> ModuleWriter:
    """Begin a program over a robot's modules.

    Args:
        inputs: Kind of each input: coordinates "q", freedoms "v", "module" for one number of each, or one of
            `more`.
        outputs: Kind of each output.
        more: Number of entries of another kind, and those of each module.
    """
    robot = request.robot
    q, v = ([getattr(m, index) for m in robot.modules] for index in ("q_index", "v_index"))
    each = [np.array([k]) for k in range(len(robot.modules))]
    kinds = {"q": (robot.nq, q), "v": (robot.nv, v), "module": (len(each), each), **more}
    chosen = request.arguments if isinstance(request.arguments, ChosenNumbers) else None
    return ModuleWriter(name, inputs, outputs, kinds, chosen.column if chosen else None)


def keep_base(w: ModuleWriter) -> None:
    """Copy the prescribed motion of a moving base to the outputs."""
    six = np.arange(6)
    w.keep(q=("near", np.arange(7)), v_closed=("v", six), a_closed=("a", six))


def by_motors(kernel: LoopKernel, closed: float) -> Kernel:
    """Return the closing kernel of modules of one shape.

    Args:
        closed: Largest step of closed loops. Where numbers are arguments, the guard includes the rows without
            a pivot, which may depend on the others no longer, or not on this branch.
    """
    m, loops, tree = kernel.m, kernel.loops, kernel.loops.tree
    (q_col, q), (v_col, v), (a_col, a) = symbols("q", tree.nq), symbols("v", tree.nv), symbols("a", tree.nv)
    w_col, w = symbols("w", tree.nv)
    rows = kernel.rows(q, w)
    K, residual = rows.K, rows.residual
    step, v, doubts = loops.step(rows, loops.independent(v))
    a = loops.accelerations(rows, loops.independent(a), drift(tree, rows, q_col, w_col, v))
    guard = ca.fmax(squares(doubts), largest(step / loops.unit) / closed)
    if _has_more_rows(kernel, K):
        scale = m.spanning_row_scale
        speed = largest(v / loops.unit)
        guard = ca.fmax(guard, largest(residual * scale) / closed)
        held = largest(dot(K, v) * scale) <= closed * speed
        guard = ca.fmax(guard, ca.if_else(held, 0.0, OTHER_STRUCTURE))
    moved = loops.moved(q, step)
    return kernel.kernel("close", [q_col, v_col, a_col], [pack(moved), pack(v), pack(a), guard])


def newton_step(kernel: LoopKernel, closed: float) -> Kernel:
    """Return the kernel of the Newton step of `by_motors`, with its inputs and without rates."""
    loops = kernel.loops
    (q_col, q), (v_col, _), (a_col, _) = (
        symbols(name, n) for name, n in (("q", loops.tree.nq), ("v", loops.tree.nv), ("a", loops.tree.nv))
    )
    rows = kernel.rows(q)
    step, _, doubts = loops.solved(rows.K, -rows.residual[:, None])
    guard = ca.fmax(squares(doubts), largest(step[:, 0] / loops.unit) / closed)
    if _has_more_rows(kernel, rows.K):
        guard = ca.fmax(guard, largest(rows.residual * kernel.m.spanning_row_scale) / closed)
    return kernel.kernel("newton", [q_col, v_col, a_col], [pack(loops.moved(q, step[:, 0])), guard])


def _has_more_rows(kernel: LoopKernel, K: Sized) -> bool:
    """Return whether rows without a pivot have to be watched: they may depend on the others no longer."""
    return bool(len(K)) and (bool(kernel.specs) or len(K) > len(kernel.loops.pivots.rows))


def turning(kernel: LoopKernel) -> Kernel:
    """Return the kernel that compares two postures of modules, see `turning_program`."""
    loops = kernel.loops
    (near_col, near), (q_col, q) = (symbols(name, loops.tree.nq) for name in ("near", "q"))
    K, K_there = (kernel.rows(x).K for x in (near, q))
    change, _ = loops.turned(K, K_there, loops.dependent)
    sums = (sum(ca.fabs(x) for x in row if not is_zero(x)) for row in change[loops.dependent])
    turned = reduce(ca.fmax, sums, ca.SX(0.0))
    return kernel.kernel("turning", [near_col, q_col], [turned / MOST_TURNING])


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
    outputs = {"q": "q"} | dict.fromkeys(("xi_next", "v_closed", "xi_dot", "independent"), "v")
    outputs |= dict.fromkeys(MEASURES, "module")
    w = loop_writer(request, "lift", {"q_0": "q", "xi": "v", "v": "v"}, outputs)
    for key, numbers, kernel in loop_kernels(request, set(), follows=False):
        w.add(key, numbers, _lift(kernel))
    return w.program()


def _lift(kernel: LoopKernel) -> Kernel:
    """Return the kernel of modules of one shape, see `lift_program`."""
    m, loops, tree = kernel.m, kernel.loops, kernel.loops.tree
    (q_col, q_0), (xi_col, xi) = symbols("q_0", tree.nq), symbols("xi", tree.nv)
    v_col, v = symbols("v", tree.nv)
    rows = kernel.rows(loops.moved(q_0, xi))
    step, rates, doubts = loops.step(rows, loops.independent(v))
    outputs = [
        pack(loops.moved(q_0, xi + step)),
        pack(xi + step),
        pack(rates),
        pack(tree.by_joint(displacement.pull, [], [xi, rates])),
        pack(loops.independent(np.ones(tree.nv))),
        largest(step / loops.unit),
        ca.fmin(1.0, TRUSTED_PIVOT / largest(doubts)),
        largest(rows.residual * m.spanning_row_scale),
    ]
    return kernel.kernel("lift", [q_col, xi_col, v_col], outputs)
