"""MuJoCo: the same robot with equality constraints, which are soft; how soft is its setting.

At a closed posture only the impedance (solimp) and the iterations count for accelerations: the reference
acceleration of `solref` vanishes there. MuJoCo also leaves J_dot v out. Both show as error.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import hybridyn
from benchmarks.methods import Method, NotMeasuredError, Setting, Solver, grid
from benchmarks.peers.pinocchio_loops import at_points
from hybridyn import HybridRobot, HybridynError
from hybridyn.spatial import Array
from hybridyn.studies.compare.engine import SINGLE
from hybridyn.studies.compare.engines.mujoco_engine import MujocoEngine

SETTINGS = grid(impedance=(0.9, 0.99, 0.999, 0.9999), iterations=(1, 2, 5, 20, 100))


class Translated:
    """A robot in MuJoCo, its states in the order of the spanning tree.

    Attributes:
        mujoco, model, data: The package and its model and data.
        to_q, to_v: Where joints stand in its positions and velocities.
    """

    def __init__(self, robot: HybridRobot, rigid: bool = True) -> None:
        """Translate a robot as `hybridyn.convert` does.

        Args:
            robot: The robot.
            rigid: Whether friction, springs, rotors and contacts are left out, as `hybridyn compare` does.

        Raises:
            NotMeasuredError: MuJoCo is not installed, or cannot state the robot.
        """
        try:
            import mujoco
        except ImportError:
            raise NotMeasuredError("the package mujoco is not installed") from None
        if robot.base != "fixed" or set(robot.kinds) - set(SINGLE):
            raise NotMeasuredError("only hinges and slides on a fixed base are written as MJCF")
        self.mujoco: Any = mujoco
        robot = at_points(robot) if rigid else robot
        try:
            with tempfile.TemporaryDirectory() as folder:
                file = Path(folder) / "robot.xml"
                hybridyn.convert(robot, file)
                self.model: Any = mujoco.MjModel.from_xml_path(str(file))
            self.data: Any = MujocoEngine(robot, self.model, "").data if rigid else mujoco.MjData(self.model)
        except (ValueError, HybridynError) as error:
            raise NotMeasuredError(f"MuJoCo: {str(error).splitlines()[0]}") from None
        if rigid:
            mujoco.mj_setConst(self.model, self.data)  # rotors are gone
            self.model.opt.tolerance = 0.0
            self.model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_WARMSTART)
        joints = [self.model.joint(name) for name in robot.joints]
        self.to_q, self.to_v = (
            np.array([getattr(joint, key)[0] for joint in joints], dtype=int) for key in ("qposadr", "dofadr")
        )
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
            own.stiffen(setting["impedance"])
            own.model.opt.iterations = int(setting["iterations"])
            own.place(q, v)
            own.data.qfrc_applied[own.motors] = tau
            own.mujoco.mj_forward(own.model, own.data)
            out: Array = own.data.qacc[own.to_v]
            return out

        return solve

    return at


#: Velocities: 70 ms a call there, four seconds at four times as many.
MOST = 1_600

#: There is no inverse model: `mj_inverse` gives efforts on every joint, not the motors' alone.
METHODS = (Method("MuJoCo", "ddm", setup, SETTINGS, most=MOST),)
