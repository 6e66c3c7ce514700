"""`JointSides`: the map between output joints and motors on arrays of a learning framework."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..assembly.posture import holding, posture_at
from ..compiled import CompiledRobot
from ..errors import ModelError
from ..spatial import Array
from .charts import Charts
from .framework import Framework


class JointSides:
    """The map between output joints and the motors of their modules, differentiable.

    Arguments and results have the shape (..., n), as those of `LearningRobot`.

    Attributes:
        joints: Names of the output joints.
        motors: Names of the motors of their modules, as many.
    """

    def __init__(
        self,
        compiled: CompiledRobot,
        joints: tuple[str, ...],
        framework: Framework,
        charts: Charts,
        close: Callable[..., Any],
    ) -> None:
        """Check the joints at the home posture.

        Args:
            compiled: Models of the robot.
            joints: Names of the output joints.
            framework: The framework.
            charts: The joints' positions in its arrays.
            close: Closes the loops from the motion of all motors, as `LearningRobot.close`.

        Raises:
            HybridynError: The joints do not fit their modules.
        """
        robot = compiled.robot
        self.joints, self.motors = joints, compiled.joint_map(robot.home, joints).motors
        if len(self.joints) != len(self.motors):
            raise ModelError(
                f"{len(joints)} output joints ({', '.join(joints)}) have {len(self.motors)} motors "
                f"({', '.join(self.motors)}): name as many joints"
            )
        self._robot, self._fast, self._framework = robot, compiled, framework
        self._charts, self._close = charts, close
        self._v = np.array([robot.v_slices[robot.joint_index[name]].start for name in joints], dtype=int)
        own = [robot.motors.index(name) for name in self.motors]
        self._others = np.array([i for i in range(len(robot.motors)) if i not in own], dtype=int)
        self._order = np.argsort([*own, *self._others])

    def to_joints(
        self, position: Any, rate: Any = None, effort: Any = None, *, near: Any = None
    ) -> tuple[Any, Any, Any]:
        """Compute the output joints from the motors of their modules.

        Args:
            position: Positions of the motors, shape (..., m), [m or rad].
            rate: Their rates, likewise; zero by default.
            effort: Their efforts, likewise; zero by default.
            near: As in `LearningRobot.close`.

        Returns:
            Positions, rates and efforts of equal power of the joints, shapes (..., m).

        Raises:
            HybridynError: An array is wrong, or as `hybridyn.assemble` raises.
        """
        position, rate, effort, near = self._given(position, rate, effort, near)
        q, v, _ = self._moved(position, rate, near)
        felt = self._framework.xp.linalg.solve(self._slopes(position, near), effort[..., None])[..., 0]
        return self._charts.angles(q, self.joints), v[..., self._v], felt

    def to_motors(
        self, position: Any, rate: Any = None, effort: Any = None, *, near: Any = None
    ) -> tuple[Any, Any, Any]:
        """Compute the motors from the output joints, as `to_joints` the other way.

        Args:
            position: Positions of the output joints, shape (..., m), [m or rad].
            rate: Their rates, likewise; zero by default.
            effort: Their efforts, likewise; zero by default.
            near: As in `LearningRobot.close`; the joints move from there.

        Returns:
            Positions, rates and efforts of equal power of the motors, shapes (..., m).

        Raises:
            HybridynError: An array is wrong, or as `hybridyn.assemble` raises.
        """
        xp, constant = self._framework.xp, self._framework.constant
        position, rate, effort, near = self._given(position, rate, effort, near)
        near = self._framework.found(self._posture, self._robot.nq, near, constant(position))
        motors = self._charts.angles(near, self.motors)
        there = constant(xp.swapaxes(self._slopes(motors, near), -1, -2))
        change = position - constant(position)
        for _ in range(2):  # steps of Newton's method, of length zero: each gains an order of derivatives
            joints = self._charts.angles(self._moved(motors, rate, near)[0], self.joints)
            off = joints - constant(joints) - change
            motors = motors - xp.linalg.solve(there, off[..., None])[..., 0]
        slopes = self._slopes(motors, near)
        rates = xp.linalg.solve(xp.swapaxes(slopes, -1, -2), rate[..., None])[..., 0]
        return motors, rates, (slopes @ effort[..., None])[..., 0]

    def _given(self, position: Any, rate: Any, effort: Any, near: Any) -> tuple[Any, ...]:
        """Return checked arguments, zero where left out."""
        array, size = self._framework.array, len(self.motors)
        position = array("position", position, size)
        near = self._framework.still("near", self._robot.home if near is None else near, self._robot.nq)
        near = near + 0.0 * self._framework.constant(position)[..., :1]  # one for each sample
        more = (("rate", rate), ("effort", effort))
        return (position, *(0.0 * position if x is None else array(name, x, size) for name, x in more), near)

    def _moved(self, position: Any, rate: Any, near: Any) -> tuple[Any, Any, Any]:
        """Return the motion of all joints from that of these motors; all others stay."""
        xp, all_motors = self._framework.xp, self._robot.motors
        others = self._charts.angles(near, all_motors)[..., self._others]
        still = 0.0 * (position[..., :1] + rate[..., :1])
        parts = (position, others + 0.0 * position[..., :1]), (rate + still, 0.0 * others + still)
        whole = [xp.concatenate(part, axis=-1)[..., self._order] for part in parts]
        found: tuple[Any, Any, Any] = self._close(*whole, near=near)
        return found

    def _slopes(self, position: Any, near: Any) -> Any:
        """Return d(joints)/d(motors), transposed: a row for each motor, shape (..., m, m)."""
        units = self._framework.array("", np.eye(len(self.motors)), len(self.motors))
        return self._moved(position[..., None, :], units, near[..., None, :])[1][..., self._v]

    def _posture(self, near: Array, position: Array) -> Array:
        """Return the postures at positions of the output joints, each from its own posture."""
        held = holding(self._robot, self.joints)
        close = None if held is not self._robot else self._fast.assemble
        rows = [
            posture_at(held, dict(zip(self.joints, y, strict=True)), start, close)
            for start, y in zip(near, position, strict=True)
        ]
        return np.array(rows).reshape(len(near), self._robot.nq)
