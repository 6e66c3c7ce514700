"""Backward sweep of the inverse model: compute forces, efforts and reactions, the outermost modules first."""

from __future__ import annotations

import numpy as np

from ..spatial import Array
from ..structure.module import ModuleState, RobotMotion
from ..structure.robot import HybridRobot
from .forward import base_motion, forward
from .inverse_guards import Guards
from .inverse_recursion import module_forces
from .loads import Loads
from .reactions import Reactions, module_reactions


def backward(
    robot: HybridRobot,
    states: list[ModuleState],
    loads: Loads,
    guards: Guards,
    tau: Array,
    result: Reactions | None,
    motion: RobotMotion,
) -> None:
    """Compute the forces that every module needs, the efforts of its motors and the wrench on its base.

    Args:
        states: States of its modules.
        loads: External wrenches and effects.
        guards: Checks of the results, and how the load is distributed among motors.
        tau: Efforts, shape (T, motors); filled in place, or read if `guards.sharing` is None.
        result: Reactions, filled in place, or None.
        motion: Motion of the robot.
    """
    received = [np.zeros((len(motion.q), len(s.module.outputs), 6)) for s in states]
    root = np.zeros((len(motion.q), 6))
    for k in reversed(range(len(states))):
        s = states[k]
        needed = module_forces(s, loads, k, guards.motions(s), received[k])
        if guards.sharing is not None:
            tau[:, s.module.motor_index] = guards.efforts(k, s, needed)  # Eq. (33)
        if result is not None:
            module_reactions(result, s, loads.modules[k], needed.F, needed.H, tau[:, s.module.motor_index])
        if s.module.parent < 0:
            root += needed.F
        else:
            received[s.module.parent][:, s.module.parent_output] += needed.F
    if result is not None:
        result.base[:] = root + _root_body(robot, loads, motion)


def reactions_of(robot: HybridRobot, motion: RobotMotion, tau: Array, loads: Loads) -> Reactions:
    """Compute the wrenches between modules and in the closures from a motion and known efforts.

    Args:
        motion: Motion of the robot.
        tau: Efforts of the motors, shape (T, motors).
        loads: External wrenches and effects.
    """
    result, on = Reactions.empty(len(motion.q)), loads.on
    states = forward(robot, motion.q, motion.v, motion.a, on.gravity, classical=on.velocity is not None)
    backward(robot, states, loads, Guards(robot, motion, None), tau, result, motion)
    return result


def _root_body(robot: HybridRobot, loads: Loads, motion: RobotMotion) -> Array:
    """Compute the wrench that the root body needs; zero for a floating base, whose module includes it."""
    if robot.base == "floating":
        return np.zeros_like(loads.root)
    V, V_dot = base_motion(
        robot, motion.q, motion.v, motion.a, loads.on.gravity, classical=loads.on.velocity is not None
    )
    I0 = robot.root_inertia
    return V_dot @ I0 + loads.on.body_bias(V, I0) - loads.root
