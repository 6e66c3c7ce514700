"""Effects on the input or output of the models: effort limits and a prescribed base motion."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from ..description.names import did_you_mean
from ..errors import AT_SAMPLE, ActuationError, ModelError
from ..linkage.motion import Motion
from ..spatial import Array, rotation_from_quaternion
from ..structure.forms import check_form
from ..structure.robot import HybridRobot
from ..tables.rates import FEWEST_ROWS, Spline, aligned, angular_rates
from .joints import Numbers
from .links import table, within


@dataclass(frozen=True)
class Limits:
    """Effort limits of the motors: the direct model clips efforts, the inverse model raises an error.

    `effort`: limit by motor [N or N m]; None uses the limits of the robot's files, if any; there 0
    states no limit.
    """

    effort: Numbers | None = None
    name: ClassVar[str] = "limits"

    def bounds(self, robot: HybridRobot) -> Array:
        """Return the limit of each motor, shape (motors,).

        Raises:
            ModelError: A motor is unknown, or a limit is not positive.
        """
        if self.effort is None:
            return np.array([robot.records[motor].effort_limit for motor in robot.motors])
        for motor, limit in self.effort.items():
            if motor not in robot.motors:
                raise ModelError(
                    f"limits: there is no motor '{motor}'{did_you_mean(motor, robot.motors)}", element=motor
                )
            if not limit > 0:
                raise ModelError(
                    f"limits: motor '{motor}' has a limit of {limit:g}; it must be positive", element=motor
                )
        return np.array([self.effort.get(motor, np.inf) for motor in robot.motors])

    def clip(self, robot: HybridRobot, tau: Array) -> Array:
        """Clip efforts to the limits, shape (T, motors)."""
        bound = self.bounds(robot)
        return np.clip(tau, -bound, bound)

    def check(self, robot: HybridRobot, tau: Array) -> None:
        """Check that efforts, shape (T, motors), are within the limits.

        Raises:
            ActuationError: One is not; the message names motor and sample.
        """
        excess = np.abs(tau) - self.bounds(robot)
        if not (excess > 0).any():
            return
        t, motor = np.unravel_index(int(np.argmax(excess)), excess.shape)
        raise ActuationError(
            f"motor '{robot.motors[motor]}' would need {abs(tau[t, motor]):.6g}{AT_SAMPLE}, limit "
            f"{self.bounds(robot)[motor]:.6g}. Slow the motion down, or leave the effect 'limits' out",
            direction=robot.motors[motor], size=float(excess[t, motor]), sample=int(t),
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class BaseMotion:
    """Motion of the base from a table (ship, vehicle): quintic spline through positions and quaternions.

    `time` [s], shape (rows,); `pose`: x, y, z [m] and quaternion qx, qy, qz, qw of the root link in the
    world, shape (rows, 7), at least six rows. The robot must have the base "moving" (`hybridyn.with_effects`
    builds one). The table then replaces the base's part of the caller's q, v, a.
    """

    time: Array | Sequence[float]
    pose: Array | Sequence[Sequence[float]]
    name: ClassVar[str] = "base_motion"

    def __post_init__(self) -> None:
        check_form(self)
        time, pose = table(self.name, self.time, self.pose, 7)
        if len(time) < FEWEST_ROWS:
            raise ModelError(f"{self.name}: {len(time)} rows; a quintic spline needs {FEWEST_ROWS}")
        if np.abs(np.linalg.norm(pose[:, 3:], axis=1) - 1).max() > 1e-6:
            raise ModelError(f"{self.name}: quaternions must have length 1")

    @cached_property
    def _spline(self) -> Spline:
        time, pose = table(self.name, self.time, self.pose, 7)
        return Spline(time, np.concatenate([pose[:, :3], aligned(pose[:, 3:])], axis=1))

    def at(self, time: Array | None) -> tuple[Array, Array, Array]:
        """Compute the base's q (T, 7), v and a (T, 6): Pinocchio's local velocity and spatial acceleration.

        Raises:
            TrajectoryError: There is no time, or one is outside the table.
        """
        time = within(self.name, np.asarray(self.time, dtype=float), time)
        x, x_dot, x_ddot = (self._spline(time, order) for order in range(3))
        w, w_dot = angular_rates(x[:, 3:], x_dot[:, 3:], x_ddot[:, 3:])
        x[:, 3:] /= np.linalg.norm(x[:, 3:], axis=1, keepdims=True)
        base = Motion(rotation_from_quaternion(x[:, 3:]), x[:, :3], w, x_dot[:, :3], w_dot, x_ddot[:, :3])
        return x, base.twist(), base.acceleration()

    def into(
        self, robot: HybridRobot, time: Array | None, q: Array, v: Array, a: Array
    ) -> tuple[Array, Array, Array]:
        """Return q, v, a with the base's part replaced.

        Raises:
            ModelError: The robot's base is not "moving".
            TrajectoryError: There is no time, or a time is outside the table.
        """
        if robot.base != "moving":
            raise ModelError(
                f"{self.name}: the robot's base is '{robot.base}': load it with base=\"moving\", or take it "
                "from hybridyn.with_effects(robot, effects)"
            )
        parts = self.at(time)
        return tuple(
            np.concatenate([new, old[:, n:]], axis=1)
            for new, old, n in zip(parts, (q, v, a), (7, 6, 6), strict=True)
        )  # type: ignore[return-value]
