"""Program for exported C: the motion of all joints from poses of the platforms, and of the other motors."""

from __future__ import annotations

import casadi as ca
import numpy as np

from ....linkage.motion import Motion
from ....linkage.reduction import decide_rank
from ....spatial import Array, cross, quaternion_from_rotation, rotation_from_quaternion
from ....structure.module import Module
from ....structure.robot import HybridRobot
from ....symbols import Expression, dot
from ...equations.expressions import pack, symbols
from ...equations.request import Request
from ...equations.scales import GUARD_CLOSED
from ...program import Program
from ..close import CLOSED, by_motors, freedoms_of, keep_base, loop_writer
from ..loop_kernels import Kernel, loop_kernels
from ..writer import alike
from .extended import extended
from .given import POSE, Given
from .kernels import ModuleKernels
from .module_parts import CONTRADICTING_FILE, MOST_FREEDOMS
from .own_requests import modules_of


def posed_modules(robot: HybridRobot) -> list[int]:
    """Return the numbers of the modules whose posture the pose of one platform determines."""
    return [k for k, module in modules_of(robot) if _by_pose(module)]


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
    counted = [posed.index(k) if k in posed else -1 for k in range(len(robot.modules))]
    pose, twist = ((n * len(posed), [n * i + np.arange(n) for i in counted]) for n in (7, 6))
    motion = {"pose": "pose", "twist": "twist", "twist_dot": "twist"}
    inputs = {"near": "q", **motion, "v": "v", "a": "v"}
    w = loop_writer(request, "close_platforms", inputs, CLOSED, pose=pose, twist=twist)
    if robot.base != "fixed":
        keep_base(w)
    closed, modules = GUARD_CLOSED[request.dtype], robot.modules
    shapes = alike(posed, lambda k: (extended(modules[k].mechanism).shape, modules[k].mobility))
    for key, numbers in shapes.items():
        w.add(("posed", key), numbers, _by_poses([modules[k] for k in numbers], closed), "near", *motion)
    rest = [k for k, _ in modules_of(robot) if k not in posed]
    for key, numbers, kernel in loop_kernels(request, freedoms_of(robot, robot.motors), rest):
        w.add(key, numbers, by_motors(kernel, closed), "near", "v", "a")
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


def _by_pose(module: Module) -> bool:
    """Return whether the pose of a module's platform determines it, by rows that do not contradict."""
    m = module.mechanism
    if len(m.spec.platforms) != 1 or module.mobility != 6 or m.rounding > CONTRADICTING_FILE:
        return False
    free = np.ones(m.tree.nv, dtype=bool)
    free[m.tree.v_slices[m.spec.platforms[0]]] = False
    K = m.reduction.scaled(m.generic_K)[:, :, free]
    return bool(decide_rank(K, m.rank_tolerance).rank == free.sum() <= MOST_FREEDOMS)


def _by_poses(modules: list[Module], closed: float) -> Kernel:
    """Return the kernel of modules of one shape with posed platforms, and the table of their numbers."""
    m = modules[0].mechanism
    settle, numbers = ModuleKernels(modules, Given(m.spec.platforms, (POSE,), ()), ()).write()["settle"]
    near, table = ca.SX.sym("near", m.spanning.nq), ca.SX.sym("numbers", numbers.shape[1])
    columns = [symbols(name, size) for name, size in (("pose", 7), ("twist", 6), ("twist_dot", 6))]
    rates = _in_own_axes(*(values for _, values in columns))
    posed = [columns[0][0], *map(pack, rates)]
    unread = ca.SX.zeros(7, 1)  # the pose is given, not that of a last posture
    here = [near, unread]
    moved, _, rate, acceleration, step, *_, guard = settle.call([*here, *here, posed[0], *posed, table])
    guard = ca.fmax(guard, step / closed)
    inputs = [near, *(column for column, _ in columns), table]
    return ca.Function("close_platforms", inputs, [moved, rate, acceleration, guard]), numbers


def _in_own_axes(pose: Expression, twist: Expression, change: Expression) -> tuple[Expression, Expression]:
    """Convert a platform's twist and its derivative to its own axes; the derivative becomes spatial."""
    back = rotation_from_quaternion(pose[3:]).T
    spatial = change[:3] - cross(twist[3:], twist[:3])
    return (
        np.concatenate([dot(back, twist[:3]), dot(back, twist[3:])]),
        np.concatenate([dot(back, spatial), dot(back, change[3:])]),
    )
