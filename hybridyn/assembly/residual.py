"""Closure residuals of postures."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..spatial import Array
from ..structure.module import Module
from ..structure.robot import HybridRobot
from ..structure.samples import as_positions


def residuals(robot: HybridRobot, q: Array) -> Iterator[tuple[Module, Array]]:
    """Yield each module that has loops with its scaled closure residuals, shape (T, rows)."""
    for module in robot.modules:
        m = module.mechanism
        if m.spanning_closures.rows:
            qk = q[:, module.q_index]
            yield module, m.residual(qk, m.spanning.sweep(qk))


def closure_residual(robot: HybridRobot, q: Array) -> Array:
    """Compute the largest closure residual of each sample, relative to its module's length.

    Args:
        robot: The robot.
        q: Positions, shape (nq,) or (T, nq).

    Returns:
        Shape () or (T,): metres over the module's length, or radians, whichever is larger.
    """
    batch, single = as_positions(robot, q)
    worst = np.zeros(len(batch))
    for _, residual in residuals(robot, batch):
        worst = np.maximum(worst, np.abs(residual).max(axis=1))
    return worst[0] if single else worst
