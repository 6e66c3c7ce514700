"""What the tests of learning frameworks share: states, functions of the models, tolerances."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybridyn
from hybridyn.structure.building import build_robot
from tests.quantities.ankle import MOTORS, ankle_text
from tests.robots.shipped import shipped
from tests.support.files import save

#: PyTorch's own forward mode calls what it has deprecated.
FORWARD_MODE = [
    pytest.mark.filterwarnings(f"ignore:.*torch.jit.script:{kind.__name__}")
    for kind in (DeprecationWarning, FutureWarning)
]
#: Rounding, and the condition of loops and of the mass matrix.
ROUNDING = 1e-10
#: Light cranks accelerate at some hundred rad/s^2, of which differences keep fewer digits.
LIGHT = 1e-2


def efforts(model: Any, *motion: Any) -> Any:
    """Compute efforts from the motors' motion."""
    return model.idm(*model.close(*motion))


def accelerations(model: Any, position: Any, rate: Any, tau: Any) -> Any:
    """Compute the accelerations of all joints from the motors' state and efforts."""
    return model.ddm(*model.close(position, rate)[:2], tau)


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
