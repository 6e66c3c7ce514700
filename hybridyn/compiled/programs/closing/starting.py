"""Closed postures from which rows are followed."""

from __future__ import annotations

import numpy as np

from ....assembly.assemble import spanning_positions
from ....linkage.newton import LoopProblem, close
from ....spatial import Array
from ....structure.robot import HybridRobot
from ...library.closed_rows import Place
from .part import CLOSED_TO_ROUNDING, Part, places_at


def place_of(robot: HybridRobot, parts: list[Part], guess: Array) -> Place | None:
    """Return the closed posture at a guess; None if its loops do not close near it.

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
    return Place(q, p[0], g[0])
