"""Motions of bodies as rows of numbers, in the layout of the program "kinematics"."""

from __future__ import annotations

import numpy as np

from ...dynamics.link_motion import body_motions
from ...linkage.tree import Motion
from ...spatial import Array
from ...structure.robot import HybridRobot

#: Numbers per body: axes row by row, origin, velocity, angular velocity, accelerations (classical).
WIDTH = 24


def body_rows(robot: HybridRobot, q: Array, v: Array, a: Array) -> Array:
    """Compute the motion of every body in the world frame by the general path, shape (T, WIDTH bodies)."""
    out = np.zeros((len(q), len(robot.bodies.bodies), WIDTH))
    for body, m in body_motions(robot, q, v, a).items():
        R = np.broadcast_to(m.R, (len(q), 3, 3)).reshape(-1, 9)
        out[:, body] = np.concatenate([R, m.p, m.p_dot, m.w, m.p_ddot, m.w_dot], axis=1)
    return out.reshape(len(q), -1)


def body_motion(rows: Array, body: int) -> Motion:
    """Return the motion of one body from rows of all, shape (T, WIDTH bodies)."""
    x = rows[:, WIDTH * body : WIDTH * (body + 1)]
    R, p, p_dot, w, p_ddot, w_dot = (
        x[:, i:j] for i, j in ((0, 9), (9, 12), (12, 15), (15, 18), (18, 21), (21, 24))
    )
    return Motion(R.reshape(-1, 3, 3), p, w, p_dot, w_dot, p_ddot)
