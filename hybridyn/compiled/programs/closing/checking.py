"""Closed postures from which rows are followed, and the check of a newly built closing program."""

from __future__ import annotations

import numpy as np

from ....assembly.assemble import spanning_positions
from ....linkage.newton import LoopProblem, close
from ....manifold.manifold import Manifold
from ....spatial import Array, Mask
from ....structure.robot import HybridRobot
from ...failures import check_agreement
from ...library.closed_rows import ClosedRows, Rows
from .choosing import CLOSED_TO_ROUNDING, Part, places_at


def place_of(robot: HybridRobot, parts: list[Part], guess: Array) -> Rows | None:
    """Return the closed posture at a guess, see `ClosedRows.close`; None if its loops do not close near it.

    Args:
        parts: Its modules but a free base.
        guess: Positions of the spanning tree, shape (nq,).
    """
    q, cut = guess.copy(), []
    for part in parts:
        m, at = part.module.mechanism, part.module.q_index
        x = m.cut.positions(q[None, at])
        if m.closures.rows:
            scale = m.reduction.row_scale
            open_by = np.abs(m.closures.residual(x, m.tree.sweep(x)) * scale).max()
            if not open_by <= CLOSED_TO_ROUNDING:
                every = np.ones(m.tree.nv, dtype=bool)
                found = close(LoopProblem(m.closures, scale, m.reduction.col_scale, every), x)
                if not found.residual[0] <= max(robot.closure_tolerance, 1e-12):
                    return None
                x = found.q
                q[at] = spanning_positions(part.module, x, m.tree.sweep(x), q[at])[0]
        cut.append(x)
    p, g = places_at(parts, cut, 1)
    return q, p[0], g[0]


#: Number of generic postures that are tried, and how far the row is from each (rad, module lengths).
POSTURES, ROW_AWAY = 4, 1e-3
#: Largest difference from the general path, relative to the largest entry of each result: rounding, through
#: the condition of loops at any posture.
ROWS_AGREE = 1e-8


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
        given: list[list[Array]] = [[], [], []]
        for part in parts:
            for own, new in zip(given, _move(part, number, start, wanted), strict=True):
                own.append(new)
        room = [x[None, None].copy() for x in wanted]
        place, row = place_of(robot, parts, start), [np.concatenate(own)[None] for own in given]
        if place is None or not rows.close(design[None], place, row, room, guess=False, strict=True)[0]:
            continue
        q, v, _ = found = [x[0, 0] for x in room]
        spun = (
            [manifold.residual(q)[0], manifold.opening(q, v)[0]] if any(part.spins for part in parts) else []
        )
        offs = [
            np.abs(x - right)[at].max(initial=0.0) / (1.0 + np.abs(right).max())
            for x, right, at in zip(found, wanted, compared, strict=True)
        ]
        check_agreement(robot, "motion of the loops", [*offs, *spun], ROWS_AGREE)


def _compared(robot: HybridRobot, parts: list[Part]) -> tuple[Mask, Mask, Mask]:
    """Return the positions, rates and accelerations that do not depend on how far rods have spun."""
    q, v = np.ones(robot.nq, dtype=bool), np.ones(robot.nv, dtype=bool)
    for part in parts:
        module, m = part.module, part.module.mechanism
        balls = [m.spec.tree_joint[m.tree.dof_body[spin.col] - 1] for spin in part.spins]
        wrists = [joint for wrist in m.spec.wrists for joint in wrist.joints if part.spins]
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
    v, a = m.cut.to_spanning(x_dot), m.cut.to_spanning(x_ddot)
    m.wrists.recover(q, v, None, motion)
    m.wrists.recover(q, v, a, motion)
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
