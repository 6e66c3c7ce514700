"""Program for exported C: the motion of all joints from poses of the platforms, and of the other motors."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from ....linkage.newton import LoopProblem
from ....linkage.tree import Motion
from ....spatial import Array, quaternion_from_rotation
from ....structure.module import Module
from ....structure.robot import HybridRobot
from ...equations.expressions import Expression, cross, dot, pack, symbols
from ...equations.guards import GUARD_CLOSED
from ...equations.loops import shape_of
from ...equations.request import Request
from ...equations.rigid import quaternion_matrix
from ...program import Constants, Program, Source, Target, Worst
from ..close import by_motors, freedoms_of, keep_base, motor_freedoms
from ..writer import Writer
from .choosing import CONTRADICTING_FILE, MOST_FREEDOMS, modules_of
from .extended import extended
from .given import POSE, Given
from .kernels import ModuleKernels


def posed_modules(robot: HybridRobot) -> list[int]:
    """Return the numbers of the modules whose posture the pose of one platform determines."""
    return [k for k, module in modules_of(robot) if _by_pose(module) is not None]


def close_platforms_program(request: Request) -> Program | None:
    """Build the program that closes loops from platform poses, or return None if none determines a module.

    Inputs are "near", a posture with the present positions of motors of modules without a posed platform and
    the other joints' previous ones; for each of `posed_modules` the "pose" of its platform in its base,
    "twist" (velocity of its origin, angular velocity) and "twist_dot" (classical), in the base's axes; "v"
    and "a", of which the entries of motors of the other modules are read. Outputs are those of the program
    "close".
    """
    robot = request.robot
    posed = posed_modules(robot)
    if not posed:
        return None
    count, driven = len(posed), freedoms_of(robot, robot.motors)
    inputs = [("near", robot.nq), ("pose", 7 * count), ("twist", 6 * count), ("twist_dot", 6 * count)]
    inputs += [("v", robot.nv), ("a", robot.nv)]
    w = Writer("close_platforms", inputs, [("q", robot.nq), ("v_closed", robot.nv), ("a_closed", robot.nv)])
    if robot.base != "fixed":
        keep_base(w)
    shapes: dict[Any, list[int]] = {}
    for k, module in modules_of(robot):
        own = extended(module.mechanism).shape, module.mobility
        key = own if k in posed else shape_of(module, motor_freedoms(module, driven))
        shapes.setdefault((k in posed, key), []).append(k)
    for shape, numbers in shapes.items():
        modules, closed = [robot.modules[k] for k in numbers], GUARD_CLOSED[request.dtype]
        if shape[0]:
            function, table = _by_poses(modules, closed)
        else:
            function, table = by_motors(modules, motor_freedoms(modules[0], driven), closed)
        q, v = (np.array([getattr(m, index) for m in modules]) for index in ("q_index", "v_index"))
        sources: list[Source] = [w.from_given("near", q), w.from_given("v", v), w.from_given("a", v)]
        if shape[0]:
            at = np.array([posed.index(k) for k in numbers])[:, None]
            sources[1:] = [
                w.from_given("pose", 7 * at + np.arange(7)),
                w.from_given("twist", 6 * at + np.arange(6)),
                w.from_given("twist_dot", 6 * at + np.arange(6)),
            ]
        targets: list[Target] = [w.result("q", q), w.result("v_closed", v), w.result("a_closed", v), Worst()]
        kernel = w.kernel(shape, function, "closures")
        w.call(kernel, len(modules), [*sources, Constants(table)], targets)
    return w.program()


def platform_motions(robot: HybridRobot, q: Array, v: Array, a: Array) -> dict[str, Array]:
    """Compute the inputs "pose", "twist", "twist_dot" of states, shapes (T, 7 posed), (T, 6 posed) twice."""
    parts: dict[str, list[Array]] = {"pose": [], "twist": [], "twist_dot": []}
    for k in posed_modules(robot):
        module = robot.modules[k]
        m, at = module.mechanism, module.v_index
        motion: Motion = m.spanning.sweep(q[:, module.q_index], v[:, at], a[:, at])
        body = int(m.cut.bodies[m.spec.platforms[0] + 1])
        parts["pose"] += [motion.p[:, body], quaternion_from_rotation(motion.R[:, body])]
        parts["twist"] += [motion.p_dot[:, body], motion.w[:, body]]
        parts["twist_dot"] += [motion.p_ddot[:, body], motion.w_dot[:, body]]
    return {name: np.concatenate(own, axis=1) for name, own in parts.items()}


def _by_pose(module: Module) -> Given | None:
    """Return what prescribes a module by the pose of its platform; None if that does not determine it."""
    platforms = module.mechanism.spec.platforms
    given = Given(platforms, (POSE,) * len(platforms), ())
    whole = len(platforms) == 1 and module.mobility == 6
    return given if whole and _determined(module, given) else None


def _determined(module: Module, given: Given) -> bool:
    """Return whether what is given determines all freedoms, by rows that do not contradict each other."""
    m = module.mechanism
    free = np.ones(m.tree.nv, dtype=bool)
    free[given.columns(m.tree)] = False
    if free.sum() > MOST_FREEDOMS or m.rounding > CONTRADICTING_FILE:
        return False
    K = LoopProblem(m.closures, m.reduction.row_scale, m.reduction.col_scale, free).matrix(
        m.tree.sweep(m.postures)
    )
    s = np.linalg.svd(K[:, :, free], compute_uv=False) if free.any() else np.ones((1, 1))
    enough = not free.any() or (K.shape[1] >= free.sum())
    return bool(enough and np.median(s[:, -1] / s[:, 0]) > m.rank_tolerance)


def _by_poses(modules: list[Module], closed: float) -> tuple[ca.Function, Array]:
    """Return the kernel of modules of one shape with posed platforms, and the table of their numbers."""
    m = modules[0].mechanism
    written = ModuleKernels(modules, Given(m.spec.platforms, (POSE,), ()), ()).write()
    near, table = ca.SX.sym("near", m.spanning.nq), ca.SX.sym("numbers", written.table.shape[1])
    columns = [symbols(name, size) for name, size in (("pose", 7), ("twist", 6), ("twist_dot", 6))]
    rates = _in_own_axes(*(values for _, values in columns))
    posed = [columns[0][0], *map(pack, rates)]
    unread = ca.SX.zeros(7, 1)  # the pose is given, not that of a last posture
    here = [near, unread]
    moved, _, rate, acceleration, step, *_, guard = written.settle.call(
        [*here, *here, posed[0], *posed, table]
    )
    guard = ca.fmax(guard, step / closed)
    inputs = [near, *(column for column, _ in columns), table]
    return ca.Function("close_platforms", inputs, [moved, rate, acceleration, guard]), written.table


def _in_own_axes(pose: Expression, twist: Expression, change: Expression) -> tuple[Expression, Expression]:
    """Convert a platform's twist and its derivative to its own axes; the derivative becomes spatial."""
    back = quaternion_matrix(pose[3:]).T
    spatial = change[:3] - cross(twist[3:], twist[:3])
    return (
        np.concatenate([dot(back, twist[:3]), dot(back, twist[3:])]),
        np.concatenate([dot(back, spatial), dot(back, change[3:])]),
    )
