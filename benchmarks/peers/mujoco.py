"""MuJoCo: the same robot with equality constraints, which are soft; how soft is its setting.

At a closed posture only the impedance (solimp) and the iterations count for accelerations: the reference
acceleration of `solref` vanishes there. MuJoCo also leaves J_dot v out. Both show as error.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.methods import Method, NotMeasuredError, Setting, Solver, grid
from benchmarks.peers.mjcf import mjcf
from hybridyn import HybridRobot
from hybridyn.spatial import Array

SETTINGS = grid(impedance=(0.9, 0.99, 0.999, 0.9999), iterations=(1, 2, 5, 20, 100))


class Translated:
    """A robot in MuJoCo, its states in the order of the spanning tree.

    Attributes:
        mujoco, model, data: The package and its model and data.
    """

    def __init__(self, robot: HybridRobot) -> None:
        """Translate a robot.

        Raises:
            NotMeasuredError: MuJoCo is not installed, or cannot state the robot.
        """
        try:
            import mujoco
        except ImportError:
            raise NotMeasuredError("the package mujoco is not installed") from None
        self.mujoco: Any = mujoco
        try:
            self.model: Any = mujoco.MjModel.from_xml_string(mjcf(robot))
        except ValueError as error:
            raise NotMeasuredError(f"MuJoCo: {str(error).splitlines()[0]}") from None
        self.data: Any = mujoco.MjData(self.model)
        joints = [self.model.joint(name) for name in robot.joints]
        self.to_q = np.array([j.qposadr[0] for j in joints], dtype=int)
        self.to_v = np.array([j.dofadr[0] for j in joints], dtype=int)
        self.motors = self.to_v[robot.motor_v]
        self.cosine = np.array([at.start for at in robot.q_slices], dtype=int)
        self.turning = np.array([kind == "continuous" for kind in robot.kinds])
        self.sine = self.cosine + self.turning

    def place(self, q: Array, v: Array) -> None:
        """Set a state."""
        x = q[self.cosine]
        if self.turning.any():
            x = np.where(self.turning, np.arctan2(q[self.sine], x), x)
        self.data.qpos[self.to_q] = x
        self.data.qvel[self.to_v] = v

    def state(self) -> tuple[Array, Array]:
        """Return the state."""
        x = self.data.qpos[self.to_q]
        q = np.zeros(len(x) + int(self.turning.sum()))
        q[self.sine] = np.where(self.turning, np.sin(x), 0.0)
        q[self.cosine] = np.where(self.turning, np.cos(x), x)
        return q, self.data.qvel[self.to_v]

    def stiffen(self, impedance: float) -> None:
        """Set how stiff the closures are, at most 0.9999."""
        self.model.eq_solimp[:, :2] = impedance


def setup(robot: HybridRobot) -> Callable[[Setting], Solver]:
    """Prepare a robot."""
    own = Translated(robot)

    def at(setting: Setting) -> Solver:
        def solve(q: Array, v: Array, tau: Array) -> Array:
            own.place(q, v)
            own.data.qfrc_applied[own.motors] = tau
            own.mujoco.mj_forward(own.model, own.data)
            out: Array = own.data.qacc[own.to_v]
            return out

        def solve_stiff(q: Array, v: Array, tau: Array) -> Array:
            own.stiffen(setting["impedance"])
            own.model.opt.iterations = int(setting["iterations"])
            return solve(q, v, tau)

        return solve_stiff

    return at


def inverse(robot: HybridRobot) -> Callable[[Setting], Solver]:
    """Say why there is no inverse model."""
    raise NotMeasuredError("mj_inverse gives efforts on every joint, passive ones too, not the motors'")


#: Velocities: 70 ms a call there, four seconds at four times as many.
MOST = 1_600

METHODS = (Method("MuJoCo", "ddm", setup, SETTINGS, most=MOST), Method("MuJoCo", "idm", inverse))
