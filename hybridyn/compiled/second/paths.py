"""Models whose posture is moved: programs of q, a displacement "delta", rates, accelerations or efforts.

"close" is the motion of all joints that follow the motors, without a model behind it.

Over joints the posture is q moved by delta, joint by joint as Pinocchio's `integrate` does. Over motors all
joints follow the motors' entries of delta, rates and accelerations, such that loops stay closed:

    xi = E delta,  q moved by xi - K^-1 (K_dot xi) / 2      (E: how joints follow motors; K_dot along xi)

Idle motions stay besides. Both hold to second order in delta, which is zero; derivatives over delta are
those over the freedoms.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import casadi as ca
import numpy as np

from ...joints.displacement import bending, rate
from ...joints.kinds import JointKind
from ...linkage.joints import TreeJoint
from ...linkage.tree import Tree
from ...symbols import Expression
from ..equations.arguments import ChosenNumbers
from ..equations.expressions import pack, symbols
from ..equations.request import Request
from ..equations.scales import GUARD_CLOSED, largest, squares
from ..loops.engine import drift
from ..program import Program, Target, Worst
from ..programs.close import freedoms_of
from ..programs.direct import direct_inputs, write_direct_sweeps
from ..programs.inverse import inverse_inputs, write_inverse_sweeps
from ..programs.loop_kernels import Kernel, LoopKernel, loop_kernels
from ..programs.writer import Writer

#: Inputs: the posture, and its displacement.
NEAR, DELTA = "near", "delta"
#: The same of rates and accelerations of motors.
V_NEAR, A_NEAR = "v_near", "a_near"
#: The output of "close".
MOTION = "motion"


def along_joints(request: Request, model: str) -> Program:
    """Build the program of a model over its joints: its inputs, with "near" and "delta" in place of "q"."""
    robot = request.robot
    w = _begun(request, model, {"q": NEAR})
    kernel = w.kernel("moved", _moved(robot.kinds), "kinematics")
    near, delta = w.from_given(NEAR, np.arange(robot.nq)), w.from_given(DELTA, np.arange(robot.nv))
    w.call(kernel, 1, [near, delta], [w.result("q", np.arange(robot.nq))])
    _add_model(request, w, model)
    return w.program()


def along_motors(request: Request, model: str) -> Program:
    """Build the program of a model over its motors, of whose joints it reads the motors' entries.

    Inputs are "near", "delta", "v_near", and "a_near" or "tau"; the motion of all joints is an output.
    """
    direct = model == "ddm"
    w = _begun(request, model, {"q": NEAR, "v": V_NEAR} | ({} if direct else {"a": A_NEAR}))
    _follow(request, w, {name: (name, 0) for name in "qva"[: 3 - direct]})
    _add_model(request, w, model)
    return w.program()


def along_closing(request: Request) -> Program:
    """Build the program of the motion of all joints that follow the motors, one output: q, v and a.

    Inputs are "near", "delta", "v_near" and "a_near". Joints that no motor moves, as a floating base, do as
    their own entries say.
    """
    nq, nv = request.robot.nq, request.robot.nv
    inputs = [(NEAR, nq), (DELTA, nv), (V_NEAR, nv), (A_NEAR, nv)]
    w = Writer("close", inputs, [(MOTION, nq + 2 * nv)])
    _follow(request, w, {"q": (MOTION, 0), "v": (MOTION, nq), "a": (MOTION, nq + nv)})
    return w.program()


def _follow(request: Request, w: Writer, places: Mapping[str, tuple[str, int]]) -> None:
    """Add the calls by which all joints follow the motors.

    Args:
        places: Output of the positions, the rates and, if wanted, the accelerations, and where they begin.
    """
    numbers_of = request.arguments.column if isinstance(request.arguments, ChosenNumbers) else None
    modules, closed, direct = request.robot.modules, GUARD_CLOSED[request.dtype], "a" not in places
    for key, numbers, kernel in loop_kernels(request, freedoms_of(request.robot, request.robot.motors)):
        q, v = (
            np.array([getattr(modules[k], x) for k in numbers], dtype=int) for x in ("q_index", "v_index")
        )
        function, table = _followed(kernel, closed, direct)
        sources = [w.from_given(NEAR, q), w.from_given(DELTA, v)]
        sources += [w.from_given(x, v) for x in (V_NEAR, A_NEAR)[: 2 - direct]]
        ends = [(place, at + (q if name == "q" else v)) for name, (place, at) in places.items()]
        targets: list[Target] = [*(w.result(*end) for end in ends), Worst()]
        of = w.kernel(("followed", key), function, "closures")
        w.call(of, len(numbers), [*sources, w.numbers(table, numbers_of)], targets)


def _begun(request: Request, model: str, renamed: Mapping[str, str]) -> Writer:
    """Begin the program of a model, some inputs of which are computed from others."""
    robot, direct = request.robot, model == "ddm"
    given = direct_inputs(request) if direct else inverse_inputs(request)
    inputs = [(renamed.get(name, name), size) for name, size in given]
    outputs = [("a", robot.nv) if direct else ("tau", len(robot.motors))]
    outputs += [(name, size) for name, size in given if name in renamed]
    return Writer(model, [inputs[0], (DELTA, robot.nv), *inputs[1:]], outputs, computed=tuple(renamed))


def _add_model(request: Request, w: Writer, model: str) -> None:
    """Add the model to a program."""
    (write_direct_sweeps if model == "ddm" else write_inverse_sweeps)(request, w)


def _moved(kinds: Sequence[JointKind]) -> ca.Function:
    """Return the function of positions after a displacement."""
    tree = Tree([TreeJoint("", kind) for kind in kinds])
    (q_col, q), (d_col, d) = symbols("q", tree.nq), symbols("d", tree.nv)
    return ca.Function("moved", [q_col, d_col], [pack(tree.by_joint(moved, [q], [d]))])


def moved(kind: JointKind, q: Expression, delta: Expression) -> Expression:
    """Compute a position after a displacement, to second order in it: constant rates for a unit of time."""
    first = rate(kind, q, delta)
    if kind.additive:
        return q + first
    turning = delta.copy()
    turning[: kind.shift] = 0.0
    bent = bending(kind, delta[None])[0]  # shifts turn with the child's axes
    return q + first + 0.5 * (rate(kind, first, turning) + rate(kind, q, bent))  # turning is linear in q


def _followed(kernel: LoopKernel, closed: float, direct: bool) -> Kernel:
    """Return the kernel of the motion of modules of one shape that follow the motors.

    Args:
        closed: Largest step of closed loops.
        direct: Whether accelerations are left out.
    """
    loops, tree = kernel.loops, kernel.loops.tree
    (q_col, q), (delta_col, delta) = symbols("q", tree.nq), symbols("delta", tree.nv)
    (v_col, v), (a_col, a), (w_col, w) = (symbols(x, tree.nv) for x in ("v", "a", "w"))
    rows = kernel.rows(q, w)
    open_by, xi, doubts = loops.step(rows, loops.independent(delta))
    xi = xi + loops.idle_share(rows.K, delta)
    bent = loops.solved(rows.K, -0.5 * drift(tree, rows, q_col, w_col, xi)[:, None])[0][:, 0]
    end = pack(tree.by_joint(moved, [q], [xi + bent]))
    found = loops.step(rows, loops.independent(v))[1] + loops.idle_share(rows.K, v)
    motion = [pack(found)]
    if not direct:
        bend = drift(tree, rows, q_col, w_col, found)
        motion.append(
            pack(loops.accelerations(rows, loops.independent(a), bend) + loops.idle_share(rows.K, a))
        )
    there = ca.Function("motion", [q_col, v_col, a_col, kernel.folding.symbol()], motion)
    given = [q_col, delta_col, v_col] + [a_col] * (not direct)
    guard = ca.fmax(squares(doubts), largest(open_by / loops.unit) / closed)
    outputs = there.call([end, v_col, a_col, kernel.folding.symbol()])
    return kernel.kernel("followed", given, [end, *outputs, guard])
