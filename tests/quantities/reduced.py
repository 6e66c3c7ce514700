"""The model in independent coordinates from the oracle's maximal ones: tau = M u_dot + c + g, v = E u.

Closed postures along a motion of the motors, and differences of what is computed there.
"""

import numpy as np

import hybridyn
from hybridyn.structure.robot import HybridRobot
from tests.oracle import Oracle


def columns_of(oracle: Oracle, joints: tuple[str, ...]) -> list[int]:
    """Return the entries of v that are the independent coordinates: a free base's six, then the joints."""
    base = list(range(6)) if oracle.base == "floating" else []
    return base + [oracle.coordinates[name][2].start for name in joints]


def oracle_map(oracle: Oracle, q: np.ndarray, columns: list[int]) -> np.ndarray:
    """Return dq/du at one posture, shape (nv, N)."""
    Z = oracle.motions(q)
    return Z @ np.linalg.solve(Z[columns], np.eye(len(columns)))


def oracle_mass(oracle: Oracle, q: np.ndarray, columns: list[int]) -> np.ndarray:
    """Return the mass matrix at one posture, shape (N, N)."""
    C = oracle.bodies.inertia_root(oracle.posture(q), oracle_map(oracle, q, columns))
    return np.asarray(C.T @ C)


def oracle_drift(oracle: Oracle, q: np.ndarray, v: np.ndarray, columns: list[int]) -> np.ndarray:
    """Return the accelerations at u_dot = 0, a prescribed base's zero, shape (nv,)."""
    posture = oracle.posture(q)
    k = oracle.tree.drifts(posture, v)[2]
    a = np.asarray(oracle.tree.least_change(posture, -k))
    return a - oracle_map(oracle, q, columns) @ a[columns]


def oracle_bias(oracle: Oracle, q: np.ndarray, v: np.ndarray, columns: list[int]) -> np.ndarray:
    """Return the generalised force along u at u_dot = 0, shape (N,)."""
    posture = oracle.posture(q)
    V, g, _ = oracle.tree.drifts(posture, v)
    a = oracle_drift(oracle, q, v, columns)
    W = oracle.bodies.needed(posture, V, (posture.G @ a).reshape(-1, 6) + g, {})
    return np.asarray(oracle_map(oracle, q, columns).T @ (posture.G.T @ W.reshape(-1)))


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
