"""Effects that change the robot, or what goes into a recursion: payloads, limits, a prescribed base."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from ..description.names import did_you_mean
from ..description.records import Description, Link
from ..errors import ActuationError, ModelError, TrajectoryError
from ..spatial import Array, cross, rotate_back, rotation_from_quaternion
from ..structure.bodies import Body
from ..tables.rates import DEGREE, FEWEST_ROWS, aligned, angular_rates
from .joints import Numbers
from .links import at_times, table

if TYPE_CHECKING:
    from ..structure.robot import HybridRobot


@dataclass(frozen=True)
class Payload:
    """A rigid body held by a link: its mass, centre and inertia are added to the link's.

    `mass` [kg]; `com` [m], link frame; `inertia` about the centre of mass [kg m^2], link axes, shape (3, 3).
    It changes the robot: take that from `hybridyn.with_effects`, which then carries it under any effects.
    """

    link: str
    mass: float
    com: tuple[float, ...] = (0.0, 0.0, 0.0)
    inertia: tuple[tuple[float, ...], ...] = ((0.0,) * 3,) * 3
    name: ClassVar[str] = "payload"

    def __post_init__(self) -> None:
        # Tuples, so that two equal payloads compare equal whatever they were written as.
        com, inertia = np.asarray(self.com, dtype=float), np.asarray(self.inertia, dtype=float)
        if com.shape != (3,) or inertia.shape != (3, 3):
            raise ModelError(f"payload on '{self.link}': com has 3 numbers, inertia 3 x 3", element=self.link)
        object.__setattr__(self, "com", tuple(com.tolist()))
        object.__setattr__(self, "inertia", tuple(tuple(row) for row in inertia.tolist()))
        finite = np.isfinite([self.mass, *com, *inertia.ravel()]).all()
        if not finite or self.mass < 0 or not np.array_equal(inertia, inertia.T):
            raise ModelError(
                f"payload on '{self.link}': mass must not be negative, inertia symmetric", element=self.link
            )
        moments = np.linalg.eigvalsh(inertia)
        if moments[0] < -1e-12 * abs(moments[-1]) or moments[0] + moments[1] < moments[2] * (1 - 1e-9):
            raise ModelError(
                f"payload on '{self.link}': no body has principal moments {moments}", element=self.link
            )

    def onto(self, description: Description) -> Description:
        """Give a description whose link carries the payload.

        Raises:
            ModelError: There is no such link.
        """
        links = {link.name: link for link in description.links}
        if self.link not in links:
            raise ModelError(
                f"payload on unknown link '{self.link}'{did_you_mean(self.link, links)}", element=self.link
            )
        body = Body("", -1)
        origin = (np.eye(3), np.zeros(3))
        body.add(links[self.link], *origin)
        body.add(Link("", self.mass, np.array(self.com), np.array(self.inertia)), *origin)
        heavier = replace(links[self.link], mass=body.mass, com=body.com, inertia=body.inertia)
        every = tuple(heavier if link.name == self.link else link for link in description.links)
        return replace(description, links=every)


@dataclass(frozen=True)
class Limits:
    """Effort limits of the motors: the direct model clips to them, the inverse model refuses a motion beyond.

    `effort`: limit by motor [N or N m]; None takes the robot's files (none where they say none).
    """

    effort: Numbers | None = None
    name: ClassVar[str] = "limits"

    def bounds(self, robot: HybridRobot) -> Array:
        """Give the limit of each motor, shape (motors,).

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
        """Give efforts within the limits, shape (T, motors)."""
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
        """Give the base's q (T, 7), v and a (T, 6): Pinocchio's local velocities and spatial acceleration.

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
        """Give q, v, a with the base's part replaced.

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
