"""States that the tests of learning frameworks start from."""

from pathlib import Path

import numpy as np

import hybridyn
from hybridyn.structure.building import build_robot
from tests.quantities.ankle import MOTORS, ankle_text
from tests.robots.shipped import shipped
from tests.support.files import save


def near_home(name: str, seed: int = 0) -> tuple[hybridyn.HybridRobot, list[np.ndarray]]:
    """Return a shipped robot, and positions close to home, rates and accelerations of its motors."""
    robot = build_robot(shipped(name))
    random = np.random.default_rng(seed)
    position, rate, acceleration = random.normal(size=(3, len(robot.motors)))
    return robot, [robot.home[robot.motor_q] + 0.02 * position, rate, acceleration]


def floating_ankle(folder: Path) -> tuple[hybridyn.HybridRobot, list[np.ndarray]]:
    """Return a parallel ankle on a floating base; pose and twist of this, and the motors' motion and efforts.

    Its cranks are light: small efforts keep rounding of differences small.
    """
    robot = hybridyn.load(save(folder, ankle_text(), "ankle.urdf"), motors=MOTORS, base="floating")
    random = np.random.default_rng(0)
    quaternion = random.normal(size=4)
    pose = np.concatenate([random.normal(size=3), quaternion / np.linalg.norm(quaternion)])
    motors = [np.array(x) for x in ([0.05, -0.02], [0.3, -0.2], [0.1, -0.2])]
    return robot, [pose, 0.3 * random.normal(size=6), *motors]
