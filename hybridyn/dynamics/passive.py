"""Accelerations of joints without a motor, solved for zero effort."""

from __future__ import annotations

import numpy as np

from ..effects.choice import Effects
from ..errors import ModelError
from ..spatial import Array
from ..structure.robot import HybridRobot
from .articulation import accelerate, articulate
from .forward import base_motion, forward
from .loads import Loads
from .state_checks import check_closed


def needs_inertia(on: Effects) -> None:
    """Refuse a direct model without inertia.

    Raises:
        ModelError: There is none.
    """
    if on.inertia is None:
        raise ModelError(
            "the direct model needs the effect 'inertia': without it efforts make no accelerations; the "
            "inverse model does statics",
            element="inertia",
        )


def solve_passive(robot: HybridRobot, q: Array, v: Array, a: Array, loads: Loads) -> Array:
    """Compute accelerations that are those of `a` at motors and moving base, and unforced elsewhere.

    The same two sweeps with Psi Z, the prescribed part in the drift, and no motor effort: Z spans what the
    motors leave free.

    Args:
        robot: The robot.
        q: Positions, shape (T, nq).
        v: Rates, shape (T, nv).
        a: Accelerations, shape (T, nv).
        loads: External wrenches.
    """
    needs_inertia(loads.on)
    whole = loads.on.velocity is not None
    states = forward(robot, q, v, None, loads.on.gravity, classical=whole)
    check_closed(robot, states, q, v)
    modules = articulate(robot, states, loads, np.zeros((len(q), len(robot.motors))), a)
    out = np.zeros_like(a)
    if robot.base == "moving":
        out[:, :6] = a[:, :6]
    root = base_motion(robot, q, v, a, loads.on.gravity, classical=whole)[1]
    accelerate(robot, modules, root, q, v, out)
    return out
