"""Program of the wrenches that all joints and closures transmit, from a motion and the efforts along joints.

The motion of all bodies outwards, then what each module needs of its base inwards; modules share kernels as
in `kinematics`.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import casadi as ca
import numpy as np

from ...linkage.closure_rows import normals
from ...linkage.closures import Closures
from ...linkage.motion import Motion
from ...linkage.tree import Tree
from ...spatial import wrench_to_base, wrench_to_body
from ...structure.module import Module
from ...structure.robot import HybridRobot
from ...symbols import Expression, dot, minus, plus, times
from ..equations.expressions import numbers, pack, symbols, unpack, zeros
from ..equations.request import Request
from ..equations.rigid import links_of
from ..equations.transmitted import (
    LoopForces,
    body_needs,
    in_base,
    loop_forces,
    multipliers,
    scaled,
    sums_inwards,
    unit_wrenches,
)
from ..program import Program, Shared, Source, Target, Worst
from .general import WIDTH, motion_of
from .kinematics import unit_base, write_motions
from .unpacking import sizes_of
from .writer import Writer


def reactions_program(request: Request) -> Program:
    """Build the program; its inputs are q, v, a, and the efforts "along" v of motors, laws and rotors.

    Output "root" is the wrench of the ground on the root body; "module k" has the blocks of `sizes_of`.
    """
    robot = request.robot
    inputs = [(name, robot.nq if name == "q" else robot.nv) for name in ("q", "v", "a", "along")]
    sizes = [sum(int(np.prod(shape)) for shape in sizes_of(module)) for module in robot.modules]
    outputs = [("root", 6), *((f"module_{k}", size) for k, size in enumerate(sizes))]
    w = Writer("reactions", inputs, outputs)
    bodies = [w.shared(WIDTH) for _ in robot.bodies.bodies]
    stood_on = {0, *(_base(robot, module) for module in robot.modules)} - {-1}
    received = {body: w.shared(6) for body in sorted(stood_on)}
    sums = {body: w.start(place, np.zeros(6)) for body, place in received.items()}
    unit_base(request, w)
    write_motions(request, w, bodies)
    for k in reversed(range(len(robot.modules))):
        module = robot.modules[k]
        own = [robot.body_of_joint[joint] for joint in module.joints]
        result = w.result(f"module_{k}", np.arange(sizes[k]))
        if robot.base == "floating" and k == 0:
            _write_root(request, w, bodies[0], received[0], [result, w.result("root", np.arange(6))])
            continue
        at = robot.bodies.place[module.base][0]
        carrying = [i for i, body in enumerate(own) if body in received]
        key = ("transmitted", id(module.mechanism), tuple(carrying))
        kernel = w.kernel(key, partial(_module, request, module, carrying), "reactions")
        sources: list[Source] = [w.from_given("q", module.q_index)]
        sources += [w.from_given(name, module.v_index) for name in ("v", "a", "along")]
        sources += [bodies[at], *(received[own[i]] for i in carrying)]
        w.call(kernel, 1, sources, [result, sums[at], Worst()])
    if robot.base != "floating":
        _write_root(request, w, bodies[0], received[0], [w.result("root", np.arange(6))])
    return w.program()


def _base(robot: HybridRobot, module: Module) -> int:
    """Return the number of the body on which a module stands; -1 for a floating one."""
    return robot.bodies.place[module.base][0] if module.parent >= 0 else -1


def _write_root(request: Request, w: Writer, motion: Shared, received: Shared, targets: list[Target]) -> None:
    """Add the call that computes the wrench of the ground on the root body."""
    robot = request.robot
    (m_col, row), (f_col, more) = symbols("motion", WIDTH), symbols("received", 6)
    moved = motion_of(row)
    need = plus(body_needs(robot.bodies.bodies[0], moved, robot.gravity), more)
    outputs = [pack(need)]
    if robot.base == "floating":  # its module stands on the world
        in_world = pack(wrench_to_base(moved.R, moved.p, need))
        outputs = [ca.vertcat(in_world, pack(need)), in_world]
    kernel = w.kernel("root wrench", ca.Function("root", [m_col, f_col], outputs), "reactions")
    w.call(kernel, 1, [motion, received], targets)


def _module(request: Request, module: Module, carrying: Sequence[int]) -> ca.Function:
    """Return the kernel of a module.

    Inputs are its q, v, a, efforts along v, the motion of its base in the world, and what modules need of the
    bodies of its joints `carrying`. Outputs are its numbers, what it needs of its base, and the guard.
    """
    m, robot = module.mechanism, request.robot
    tree, spec = Tree([*links_of(m.spec.spanning).values()]), m.spec
    columns: list[Any] = [
        ca.SX.sym("q", tree.nq),
        *(ca.SX.sym(name, tree.nv) for name in ("v", "a", "along")),
    ]
    base_col, base = symbols("base", WIDTH)
    pairs = [symbols("received", 6) for _ in carrying]
    q, v, a, along = (unpack(column)[None] for column in columns)
    own = tree.sweep(q, v, a)
    world, received = motion_of(base[None, None]).then(own), dict(zip(carrying, pairs, strict=True))
    needs = [zeros(6)]
    for i, joint in enumerate(module.joints):
        body = robot.bodies.bodies[robot.body_of_joint[joint]]
        one = Motion(*(x[0, i + 1] for x in world.arrays))
        need = body_needs(body, one, robot.gravity)
        need = plus(need, received[i][1]) if i in received else need
        needs.append(in_base(own, i + 1, need))
    parents = [joint.parent for joint in tree.joints]
    motion_alone = sums_inwards(parents, [x[:, None] for x in needs])
    left = _left(tree, own, motion_alone, along[0])
    how, found = loop_forces(module), None
    closures = Closures(tree, [*spec.closures], [*spec.couplings])
    if closures.rows:
        K, scales = closures.matrix(own)[0], (m.spanning_row_scale, m.spanning_col_scale)
        found = multipliers(K, left, how, scales, request.plans[0].scale.eps)
    every = zeros(0, 1) if found is None else np.concatenate([found.least[:, None], found.stresses], axis=1)
    joints, closed = _transmitted(module, tree, own, needs, every, how)
    numbers_of = pack(motion_alone[0][:, 0], *joints, *closed)
    guard = ca.SX(0.0) if found is None else ca.SX(found.guard)
    outputs = [numbers_of, pack(motion_alone[0][:, 0]), guard]
    return ca.Function("transmitted", [*columns, base_col, *(column for column, _ in pairs)], outputs)


def _left(tree: Tree, own: Motion, total: Sequence[Expression], along: Expression) -> Expression:
    """Compute the forces along the joints that efforts do not give, shape (nv,)."""
    out = zeros(tree.nv)
    for i, at in enumerate(tree.v_slices):
        wrench = wrench_to_body(own.R[0, i + 1], own.p[0, i + 1], total[i + 1][:, 0])
        S = np.concatenate([numbers(tree.S_linear[at]), numbers(tree.S_angular[at])], axis=1)
        out[at] = dot(S, wrench)
    left: Expression = minus(out, along)
    return left


def _transmitted(
    module: Module, tree: Tree, own: Motion, needs: Sequence[Expression], every: Expression, how: LoopForces
) -> tuple[list[Expression], list[Expression]]:
    """Compute what joints and closures transmit, columns under the multipliers, then each self-stress.

    Args:
        needs: What each body needs without closures, shape (6,), base's frame.
        every: The multipliers, then the self-stresses, shape (rows, 1 + k).
    """
    m, spec, at = module.mechanism, module.mechanism.spec, 0
    length, closed = numbers(m.length_of_wrench), list[Expression]()
    columns = [np.concatenate([x[:, None], zeros(6, how.stresses)], axis=1) for x in needs]
    for c in spec.closures:
        A = dot(own.R[0, c.body_a], numbers(c.R_a))
        B = dot(own.R[0, c.body_b], numbers(c.R_b))
        p_b = plus(own.p[0, c.body_b], dot(own.R[0, c.body_b], numbers(c.p_b)))
        frames, lam = (A, normals(c.rotation, A, B[:, 2]), p_b), every[at : at + c.rows]
        wrench = dot(unit_wrenches(frames, c, zeros(3)), lam)
        columns[c.body_a] = plus(columns[c.body_a], wrench)
        columns[c.body_b] = minus(columns[c.body_b], wrench)
        axes = dot(A, numbers(c.turn.T))
        there = dot(unit_wrenches(frames, c, p_b), lam)
        closed.append(_as_moments(np.concatenate([dot(axes.T, there[:3]), dot(axes.T, there[3:])]), length))
        at += c.rows
    scale = m.spanning_row_scale
    for row in range(at, len(every)):
        closed.append(
            np.array([[every[row, 0], *(times(x, 1 / scale[row]) for x in every[row, 1:])]], dtype=object)
        )
    total = sums_inwards([joint.parent for joint in tree.joints], columns)
    joints = [
        _as_moments(wrench_to_body(own.R[0, i + 1], own.p[0, i + 1], total[i + 1].T).T, length)
        for i in range(len(tree.joints))
    ]
    return joints, closed


def _as_moments(columns: Expression, length: Expression) -> Expression:
    """Multiply the forces of self-stresses by the length of the module; the first column stays."""
    return np.concatenate([columns[:, :1], scaled(columns[:, 1:], length)], axis=1)
