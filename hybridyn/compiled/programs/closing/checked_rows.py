"""Check new code that closes loops: it finds generic postures again, and chains as the general path."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ....assembly.assemble import assemble_requests
from ....assembly.chain.places import motion_of
from ....assembly.poses import PoseRequest
from ....assembly.requests import Requests
from ....assembly.spanning import spanning_positions
from ....errors import HybridynError
from ....linkage.angles import angles_of
from ....linkage.loop_problem import LoopProblem
from ....linkage.motion import Motion
from ....linkage.newton import close
from ....linkage.targets import COORDINATES
from ....manifold.manifold import Manifold
from ....spatial import Array, Mask, cross, rotation_from_vector
from ....structure.robot import HybridRobot, joint_position
from ...failures import check_agreement
from ...library.closed_rows import ClosedRows, Rows
from .closing_library import Closing, place_of
from .coupled import Coupled, split_poses
from .members import wanted_of
from .module_parts import Part
from .own_requests import modules_of

#: Largest turn of joints of modules without loops, away from a singular home [rad, module lengths].
BENT = 0.7
#: Largest difference from the general path, relative to the largest entry of each result: rounding, through
#: the condition of loops at any posture.
ROWS_AGREE = 1e-8
#: Number of generic postures that are tried, and how far the row is from each (rad, module lengths).
POSTURES, ROW_AWAY = 4, 1e-3


def check_rows(rows: ClosedRows, robot: HybridRobot, parts: list[Part], design: Array) -> None:
    """Compare rows near generic postures with moving states of the general path.

    Args:
        rows: The library, as far as it is certain.
        robot: The robot, or another design of it.
        parts: The modules that it closes.
        design: Numbers in the slots, shape (slots,).

    Raises:
        CompileError: A row of which the library is certain differs.
    """
    compared, manifold = _compared(robot, parts), Manifold(robot)
    for number in range(POSTURES):
        start, wanted = robot.home.copy(), (robot.home.copy(), *np.zeros((2, robot.nv)))
        given = [_move(part, number, start, wanted) for part in parts]
        room = [x[None, None].copy() for x in wanted]
        place = place_of(robot, parts, start)
        row = [np.concatenate(own)[None] for own in zip(*given, strict=True)]
        if place is None or not rows.close(design[None], place, row, room, guess=False, strict=True)[0]:
            continue
        q, v, _ = found = [x[0, 0] for x in room]
        idle = any(part.idle for part in parts)
        opened = [manifold.residual(q)[0], manifold.opening(q, v)[0]] if idle else []
        offs = [
            np.abs(x - right)[at].max(initial=0.0) / (1.0 + np.abs(right).max())
            for x, right, at in zip(found, wanted, compared, strict=True)
        ]
        check_agreement(robot, "motion of the loops", [*offs, *opened], ROWS_AGREE)


def _compared(robot: HybridRobot, parts: list[Part]) -> tuple[Mask, Mask, Mask]:
    """Return the positions, rates and accelerations that do not depend on idle motions."""
    q, v = np.ones(robot.nq, dtype=bool), np.ones(robot.nv, dtype=bool)
    for part in parts:
        module, m = part.module, part.module.mechanism
        balls = [m.spec.tree_joint[m.tree.dof_body[col] - 1] for col in part.idle_freedoms]
        wrists = [joint for wrist in m.spec.wrists for joint in wrist.joints if part.idle]
        for joint in (*balls, *wrists):
            if joint is not None:
                q[module.q_index[m.spanning.q_slices[joint]]] = False
                v[module.v_index[m.spanning.v_slices[joint]]] = False
    return q, v, v


def _move(part: Part, number: int, start: Array, wanted: Rows) -> Rows:
    """Write a closed posture of a module into `start`, a moving state nearby into `wanted`.

    Returns:
        What is prescribed in that state, its rates and accelerations, shapes (numbers,), (rates,), (rates,).
    """
    module, m = part.module, part.module.mechanism
    rng, tree = np.random.default_rng(number), m.tree
    at, to = module.q_index, module.v_index
    x = m.postures[number % len(m.postures)][None]
    start[at] = spanning_positions(module, x, tree.sweep(x), start[at])[0]
    Psi = m.basis(m.closures.matrix(tree.sweep(x))).Psi
    way = Psi @ rng.normal(size=m.mobility)
    size = np.abs(way / m.reduction.col_scale).max(initial=1.0)
    every, r = np.ones(tree.nv, dtype=bool), m.reduction
    near = tree.integrate(x, ROW_AWAY / size * way)
    x = close(LoopProblem(m.closures, r.row_scale, r.col_scale, every, (), r.rank), near).q
    K = m.closures.matrix(tree.sweep(x))
    x_dot = m.basis(K).Psi @ rng.normal(size=m.mobility)
    basis = m.basis(K, m.closures.rates(tree.sweep(x, x_dot), x_dot)[1])
    x_ddot = basis.Psi @ rng.normal(size=m.mobility) + basis.drift
    motion = tree.sweep(x, x_dot, x_ddot)
    q = spanning_positions(module, x, motion, start[at])
    v, a = m.spanning_rates(q, x, x_dot, x_ddot)
    wanted[0][at], wanted[1][to], wanted[2][to] = q[0], v[0], a[0]
    held, bodies = part.given.columns(tree), part.given.bodies
    twists = [np.concatenate([motion.p_dot[0, b], motion.w[0, b]]) for b in bodies]
    accelerations = [np.concatenate([motion.p_ddot[0, b], motion.w_dot[0, b]]) for b in bodies]
    for one in part.given.coordinates:
        first = np.zeros(1, dtype=int)
        twists.append((one.target.matrix(tree, motion) @ x_dot[0])[0])
        accelerations.append(-one.target.rates(motion, first)[1][0])
    return (
        part.given.of_posture(tree, x)[0],
        np.concatenate([x_dot[0, held], *twists]),
        np.concatenate([x_ddot[0, held], *accelerations]),
    )


def check_chains(closing: Closing, robot: HybridRobot, requests: Requests, design: Array) -> None:
    """Compare rows of modules that poses couple with the general path, near generic postures.

    Args:
        closing: The library, and what it closes of the robot.
        robot: The robot, or another design of it.
        requests: Requests that it answers.
        design: Numbers in the slots, shape (slots,).

    Raises:
        CompileError: A row of which the library is certain differs.
    """
    compared = _compared(robot, closing.parts)
    for number in range(POSTURES):
        start = robot.home.copy()
        for part in closing.parts:
            _move(part, number, start, (start.copy(), *np.zeros((2, robot.nv))))
        start = bent(robot, start, number)
        asked = nearby_requests(robot, requests, closing.chains, start, number)
        wanted = wanted_of(robot, asked, split_poses(robot, asked))
        row = None if wanted is None else closing.numbers(wanted)
        place = None if row is None else closing.place(robot, start, row)
        if place is None or row is None:
            continue
        room = [np.empty((1, 1, n)) for n in (robot.nq, robot.nv, robot.nv)]
        if not closing.rows.close(design[None], place, row, room, guess=False, strict=True)[0]:
            continue
        try:
            right = assemble_requests(robot, asked, start)
        except HybridynError:
            continue
        offs = [
            np.abs(x[0] - y)[:, at].max(initial=0.0) / (1.0 + np.abs(y).max())
            for x, y, at in zip(room, right, compared, strict=True)
        ]
        check_agreement(robot, "motion of the chains", offs, ROWS_AGREE)


def bent(robot: HybridRobot, q: Array, seed: int) -> Array:
    """Return a posture, shape (nq,), with modules without loops turned: arms may be straight at home."""
    q, rng = q.copy(), np.random.default_rng(seed)
    for _, module in modules_of(robot):
        m, at = module.mechanism, module.q_index
        if not m.closures.rows:
            turn = BENT * rng.uniform(-1.0, 1.0, (1, m.spanning.nv)) * m.spanning_col_scale
            q[at] = m.spanning.integrate(q[None, at], turn)[0]
    return q


def nearby_requests(
    robot: HybridRobot, requests: Requests, chains: Sequence[Coupled], q: Array, seed: int
) -> Requests:
    """Return requests like some others near a posture, shape (nq,), where chains move and all else stays."""
    rng, states = np.random.default_rng(seed), (q[None], *np.zeros((2, 1, robot.nv)))
    joints = {
        name: np.array([[float(joint_position(robot, q, name))], [0.0], [0.0]]) for name in requests.joints
    }
    moving = {i: one for one in chains for i in one.poses}
    poses = []
    for i, pose in enumerate(requests.poses):
        link, other = (motion_of(robot, name, states) for name in (pose.link, pose.other))
        seen, size = link.seen_from(other), 0.0
        if i in moving:
            size = max(float(one.target.units.max()) for one in moving[i].relatives)
        shift, turn, v, w, a, alpha = (
            ROW_AWAY * rng.normal(size=(6, 1, 3)) * np.array([size, bool(size)] * 3)[:, None, None]
        )
        R = np.matmul(rotation_from_vector(turn), seen.R)
        pose = _pointing_nearby(pose, Motion(R, seen.p + shift, w, v, alpha, a))
        if pose.motion is not None:
            poses.append(pose._replace(motion=Motion(R, seen.p + shift, w, v, alpha, a)))
            continue
        values = np.concatenate([seen.p + shift, angles_of(seen.R) + turn], axis=1)
        every = dict(
            zip(
                COORDINATES,
                np.stack([values, *(np.concatenate(x, axis=1) for x in ((v, w), (a, alpha)))]).T,
                strict=True,
            )
        )
        poses.append(pose._replace(coordinates={name: every[name].T for name in pose.coordinates}))
    return requests._replace(samples=1, single=False, joints=joints, poses=tuple(poses), strict=True)


def _pointing_nearby(pose: PoseRequest, motion: Motion) -> PoseRequest:
    """Return a pose with the direction, distance and orientation of a link's motion, shape (1, ...)."""
    if pose.turn is not None:
        pose = pose._replace(turn=motion)
    if pose.direction is not None:
        axis, w = pose.direction[0], motion.w
        d = motion.R[:, :, axis]
        d_dot = cross(w, d)
        levels = np.stack([d, d_dot, cross(motion.w_dot, d) + cross(w, d_dot)])
        pose = pose._replace(direction=(axis, levels))
    if pose.distance is not None:
        centre = pose.distance[1][:, :1]
        far = np.linalg.norm(motion.p - centre[0], axis=1)
        speeds = motion.p_dot[:, 0], motion.p_ddot[:, 0]
        pose = pose._replace(distance=(np.stack([far, *speeds]), centre))
    return pose
