"""Compute the accelerations of joints without a motor for zero effort."""

from __future__ import annotations

import numpy as np

from ..effects.choice import Effects
from ..errors import ModelError
from ..spatial import Array
from ..structure.robot import HybridRobot
from .direct_recursion import accelerate, articulate
from .forward import base_motion, forward
from .loads import Loads
from .state_checks import check_closed


def needs_inertia(on: Effects) -> None:
    """Raise if the effects of a direct model do not include inertia.

    Raises:
        ModelError: The effect "inertia" is missing.
    """
    if on.inertia is None:
        raise ModelError(
            "the direct model needs the effect 'inertia': without it efforts cause no accelerations. "
            "For statics use the inverse model",
            element="inertia",
        )


def solve_passive(robot: HybridRobot, q: Array, v: Array, a: Array, loads: Loads) -> Array:
    """Compute accelerations that equal `a` at motors and at a moving base, and need no effort elsewhere.

    The recursions are those of the direct model without motor efforts, with two changes: Psi Z replaces Psi,
    where Z spans the motions with fixed motors, and the drift includes the prescribed accelerations.

    Args:
        q: Positions, shape (T, nq).
        v: Rates, shape (T, nv).
        a: Accelerations, shape (T, nv).
        loads: External wrenches and effects.

    Returns:
        Accelerations, shape (T, nv).
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
