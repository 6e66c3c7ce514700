"""Logs of robots that move as Fourier series, whose numbers are known."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

import hybridyn
from hybridyn.identification.parameters import standard_parameters
from hybridyn.identification.robot_with import with_parameters
from hybridyn.structure.robot import joint_position

PERIOD, HARMONICS, RATE = 4.0, 5, 200.0
#: Amplitude of the motors: within the loops' reach.
AMPLITUDE = {"delta": 0.12, "gough_stewart": 0.03, "five_bar": 0.2, "rps3": 0.03, "lx4": 0.012}

Table = dict[str, np.ndarray]


class Case(NamedTuple):
    """A robot, one with other masses, and the motion of its motors."""

    robot: hybridyn.HybridRobot
    true: hybridyn.HybridRobot
    base: np.ndarray
    time: np.ndarray
    motion: tuple[np.ndarray, np.ndarray, np.ndarray]
    tau: np.ndarray

    def log(self, *, rates: bool = False, tau: np.ndarray | None = None, of: str = "effort") -> Table:
        """Return a log of the motion."""
        out = {"time": self.time}
        for i, motor in enumerate(self.robot.motors):
            out[f"{motor}/position"] = self.motion[0][:, i]
            out[f"{motor}/{of}"] = (self.tau if tau is None else tau)[:, i]
            if rates:
                out[f"{motor}/velocity"], out[f"{motor}/acceleration"] = (x[:, i] for x in self.motion[1:])
        return out


@lru_cache(maxsize=16)
def case(name: str, symmetric: bool = True, seed: int = 1, rate: float = RATE) -> Case:
    """Return a robot whose bodies are up to 30 % heavier or lighter than its file says, and how it moves."""
    robot, rng = hybridyn.load(name), np.random.default_rng(seed)
    t = np.arange(int(PERIOD * rate)) / rate
    home = np.array([float(joint_position(robot, robot.home, motor)) for motor in robot.motors])
    w = 2 * np.pi / PERIOD * np.arange(1, HARMONICS + 1)
    A, B = AMPLITUDE[name] / np.sqrt(HARMONICS) * rng.normal(size=(2, HARMONICS, len(home)))
    c, s, w = np.cos(t[:, None] * w), np.sin(t[:, None] * w), w[:, None]
    motion = home + c @ A + s @ B, c @ (w * B) - s @ (w * A), -c @ (w**2 * A) - s @ (w**2 * B)
    standard = standard_parameters(robot, effects="model", symmetric=symmetric)
    values = standard.values.copy()
    for at in sorted({tuple(at) for at in standard.bodies.values()}):
        values[list(at)] *= 1 + 0.3 * rng.uniform(-1, 1)
    true = with_parameters(robot, values, effects="model", symmetric=symmetric)
    base = hybridyn.base_parameters(robot, effects="model", symmetric=symmetric).combination @ values
    tau = hybridyn.idm(true, *hybridyn.assemble(robot, motors=motion), effects="model")
    return Case(robot, true, base, t, motion, tau)
