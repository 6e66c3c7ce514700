"""Effects that change the robot, or what goes into a recursion: payloads, limits, a prescribed base."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from ..description.names import did_you_mean
from ..errors import ActuationError, ModelError, TrajectoryError
from ..spatial import Array, cross, rotate_back, rotation_from_quaternion
from ..tables.rates import DEGREE, FEWEST_ROWS, aligned, angular_rates
from .joints import Numbers
from .links import at_times, table

if TYPE_CHECKING:
    from ..structure.robot import HybridRobot


@dataclass(frozen=True)
class Limits:
    """Effort limits of the motors: the direct model clips to them, the inverse model refuses a motion beyond.

    `effort`: limit by motor [N or N m]; None takes the robot's files (none where they say none).
    """

    effort: Numbers | None = None
    name: ClassVar[str] = "limits"

    def bounds(self, robot: HybridRobot) -> Array:
        """Return the limit of each motor, shape (motors,).

        Raises:
            ModelError: An unknown motor, or a limit that is not positive.
        """
        if self.effort is None:
            record = {j.joint.name: j.joint.effort for j in robot.bodies.joints}
            return np.array([record[motor] for motor in robot.motors])
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
        """Return efforts within the limits, shape (T, motors)."""
        bound = self.bounds(robot)
        return np.clip(tau, -bound, bound)

    def check(self, robot: HybridRobot, tau: Array) -> None:
        """Refuse efforts beyond the limits.

        Raises:
            ActuationError: Naming motor and sample.
        """
        excess = np.abs(tau) - self.bounds(robot)
        if not (excess > 0).any():
            return
        t, motor = np.unravel_index(int(np.argmax(excess)), excess.shape)
        raise ActuationError(
            f"motor '{robot.motors[motor]}' would need {abs(tau[t, motor]):.6g} at sample {t}, limit "
            f"{self.bounds(robot)[motor]:.6g}. Slow the motion down, or leave the effect 'limits' out",
            direction=robot.motors[motor], size=float(excess[t, motor]), sample=int(t),
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class BaseMotion:
    """A base that moves as a table says (ship, vehicle): quintic spline through positions and quaternions.

    `time` [s], shape (rows,); `pose`: x, y, z [m] and quaternion qx, qy, qz, qw of the root link in the
    world, shape (rows, 7), six rows at least. It needs a robot with base "moving" (`hybridyn.with_effects`
    gives one); the base's part of q, v, a is then taken from here and not from the caller.
    """

    time: Sequence[float] | Array
    pose: Sequence[Sequence[float]] | Array
    name: ClassVar[str] = "base_motion"

    def __post_init__(self) -> None:
        time, pose = table(self.name, self.time, self.pose, 7)
        if len(time) < FEWEST_ROWS:
            raise ModelError(f"{self.name}: {len(time)} rows; a quintic spline needs {FEWEST_ROWS}")
        if np.abs(np.linalg.norm(pose[:, 3:], axis=1) - 1).max() > 1e-6:
            raise ModelError(f"{self.name}: quaternions must have length 1")

    @cached_property
    def _splines(self) -> tuple[Any, Any, Any]:
        from scipy.interpolate import make_interp_spline

        time, pose = table(self.name, self.time, self.pose, 7)
        spline = make_interp_spline(
            time, np.concatenate([pose[:, :3], aligned(pose[:, 3:])], axis=1), k=DEGREE
        )
        return spline, spline.derivative(1), spline.derivative(2)

    def at(self, time: Array) -> tuple[Array, Array, Array]:
        """Return the base's q (T, 7), v and a (T, 6): Pinocchio's local velocities and spatial acceleration.

        Raises:
            TrajectoryError: A time outside the table.
        """
        at_times(self.name, np.asarray(self.time, dtype=float), time)
        x, x_dot, x_ddot = (spline(time) for spline in self._splines)
        w, w_dot = angular_rates(x[:, 3:], x_dot[:, 3:], x_ddot[:, 3:])
        x[:, 3:] /= np.linalg.norm(x[:, 3:], axis=1, keepdims=True)
        R = rotation_from_quaternion(x[:, 3:])
        spatial = x_ddot[:, :3] - cross(w, x_dot[:, :3])
        v = np.concatenate([rotate_back(R, x_dot[:, :3]), rotate_back(R, w)], axis=1)
        return x, v, np.concatenate([rotate_back(R, spatial), rotate_back(R, w_dot)], axis=1)

    def into(
        self, robot: HybridRobot, time: Array | None, q: Array, v: Array, a: Array
    ) -> tuple[Array, Array, Array]:
        """Return q, v, a with the base's part replaced.

        Raises:
            ModelError: The robot's base is not "moving".
            TrajectoryError: No time, or a time outside the table.
        """
        if robot.base != "moving":
            raise ModelError(
                f"{self.name}: the robot's base is '{robot.base}': load it with base=\"moving\", or take it "
                "from hybridyn.with_effects(robot, effects)"
            )
        if time is None:
            raise TrajectoryError(f"the effect '{self.name}' follows a table: pass time=")
        parts = self.at(time)
        return tuple(
            np.concatenate([new, old[:, n:]], axis=1)
            for new, old, n in zip(parts, (q, v, a), (7, 6, 6), strict=True)
        )  # type: ignore[return-value]
