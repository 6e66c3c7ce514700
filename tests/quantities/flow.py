"""Closed postures along a motion of the motors, and differences of what is computed there."""

import numpy as np

import hybridyn
from hybridyn.structure.robot import HybridRobot
from tests.oracle import Oracle

#: Differences of the fourth order over `STEP`.
STEP, DIFFERENCE = 1e-3, 1e-8


def position_of(robot: HybridRobot, q: np.ndarray, joint: str) -> float:
    """Return the position of a joint with one freedom, an angle where q has its cosine and sine."""
    at = robot.q_slices[robot.joint_index[joint]]
    return float(q[at][0]) if at.stop - at.start == 1 else float(np.arctan2(q[at][1], q[at][0]))


def neighbours(robot: HybridRobot, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return closed postures at -2, -1, 1, 2 steps along rates; a base stays where it is."""
    near = []
    oracle = Oracle(robot.description, robot.base)
    for step in (-2, -1, 1, 2):
        at = oracle.integrate(q, step * STEP * v)
        positions = {motor: (position_of(robot, at, motor), 0.0, 0.0) for motor in robot.motors}
        pose = {} if robot.base == "fixed" else {robot.description.root: (q[:7], np.zeros(6), np.zeros(6))}
        near.append(hybridyn.assemble(robot, motors=positions, platforms=pose, guess=q)[0])
    return np.array(near)


def rate_along(values: np.ndarray) -> np.ndarray:
    """Return the derivative in the middle of four values, by `STEP`."""
    return np.asarray((values[0] - 8 * values[1] + 8 * values[2] - values[3]) / (12 * STEP))
