"""The states that every quantity begins with: arguments as batches, and modules whose loops are closed."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ...spatial import Array
from ...structure.module import ModuleState
from ...structure.robot import HybridRobot
from ...structure.samples import as_positions, as_rates, same_samples
from ..forward import forward
from ..state_checks import check_closed


def checked_state(robot: HybridRobot, q: ArrayLike, v: ArrayLike | None) -> tuple[Array, Array, bool]:
    """Return positions and rates (None: zero) as batches of equal size, and whether q was a single sample.

    Raises:
        TrajectoryError: An array has the wrong shape or is not finite.
    """
    q, single = as_positions(robot, q)
    rates = np.zeros((len(q), robot.nv)) if v is None else as_rates(robot, v)[0]
    same_samples(q=q, v=rates)
    return q, rates, single


def closed_states(robot: HybridRobot, q: Array, v: Array | None = None) -> list[ModuleState]:
    """Compute the states of the modules, without weights and accelerations.

    Args:
        q: Positions, shape (T, nq).
        v: Rates, shape (T, nv); zero by default.

    Raises:
        AssemblyError: Positions or rates do not close the loops.
    """
    rates = np.zeros((len(q), robot.nv)) if v is None else v
    states = forward(robot, q, rates, None, None)
    check_closed(robot, states, q, rates)
    return states
