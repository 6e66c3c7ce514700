"""What rounding is measured by where nothing else is left: the robot's weight, size and rates.

In free fall, coasting or at rest every term of an effort cancels, and so does every rate; what is left is
rounding, and no sum tells it from a force or a motion.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..spatial import Array
from ..structure.robot import HybridRobot

#: Rounding of a force that many terms make, relative to the largest of them and to their number.
NOISE = 8 * float(np.finfo(float).eps)
#: Rates and accelerations below this part of the robot's natural ones are rest: ten thousand roundings.
REST = 1e-12
#: Natural rate of a robot without weight that does not move [rad/s]; lengths and masses do not change it.
UNHURRIED = 1.0


@dataclass(frozen=True)
class NaturalSizes:
    """Sizes of a robot's rates and accelerations at every sample, over its lengths.

    Attributes:
        speed: Largest rate, shape (T,), [rad/s]. How fast a base travels does not count: an observer may
            travel along (Galilei).
        stated: Largest acceleration, shape (T,), [rad/s^2].
        gravity: Acceleration of gravity [m/s^2].
    """

    speed: Array
    stated: Array
    gravity: float

    @classmethod
    def of(cls, robot: HybridRobot, v: Array, a: Array | None = None) -> NaturalSizes:
        """Return a robot's sizes.

        Args:
            robot: The robot.
            v: Rates, shape (T, nv).
            a: Accelerations, shape (T, nv), zero where left out.
        """
        relative = np.abs(v / robot.unit)
        if robot.base != "fixed":
            relative[:, :3] = 0.0
        stated = np.zeros(len(v)) if a is None else np.abs(a / robot.unit).max(axis=1, initial=0.0)
        gravity = float(np.linalg.norm(robot.gravity))
        return cls(relative.max(axis=1, initial=0.0), stated, gravity)

    def rate(self, length: float) -> Array:
        """Return the rate that rounding of rates is a part of: the largest, or that of a pendulum.

        Args:
            length: The length [m].

        Returns:
            Shape (T,), [rad/s].
        """
        out: Array = np.maximum(self.speed, max(np.sqrt(self.gravity / length), UNHURRIED))
        return out

    def acceleration(self, length: float) -> Array:
        """Return the acceleration that rounding of accelerations is a part of, shape (T,), [rad/s^2]."""
        out: Array = np.maximum(self.stated, self.rate(length) ** 2)
        return out


def force_rounding(robot: HybridRobot, v: Array, a: Array) -> Array:
    """Return what rounding may leave of forces that cancel, as work per scaled coordinate, shape (T,), [N m].

    All the robot's mass at its size and natural acceleration, once for each freedom.

    Args:
        robot: The robot.
        v: Rates, shape (T, nv).
        a: Accelerations, shape (T, nv).
    """
    length = robot.bodies.size
    mass = sum(body.mass for body in robot.bodies.bodies)
    return NOISE * robot.nv * mass * length**2 * NaturalSizes.of(robot, v, a).acceleration(length)
