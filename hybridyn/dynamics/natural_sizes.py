"""Compute reference sizes for rounding from the robot's weight, size and rates.

In free fall, in motion without efforts and at rest, all terms of an effort or of a rate cancel. The result is
rounding. To recognise it as rounding, it is compared with these reference sizes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..spatial import Array
from ..structure.robot import HybridRobot

#: Rounding of a sum of forces, relative to its largest term times the number of terms.
NOISE = 8 * float(np.finfo(float).eps)
#: Rates and accelerations below this part of the reference ones count as zero: ten thousand roundings.
REST = 1e-12
#: Smallest reference rate [rad/s], for robots at rest without gravity; it depends on no length or mass.
SLOWEST = 1.0


@dataclass(frozen=True, eq=False)
class NaturalSizes:
    """Sizes of a robot's rates and accelerations at every sample, divided by the units of its freedoms.

    Attributes:
        speed: Largest rate, shape (T,), [rad/s]. The linear velocity of the base is excluded (Galilean
            invariance).
        stated: Largest acceleration, shape (T,), [rad/s^2].
        gravity: Acceleration of gravity [m/s^2].
    """

    speed: Array
    stated: Array
    gravity: float

    @classmethod
    def of(cls, robot: HybridRobot, v: Array, a: Array | None = None) -> NaturalSizes:
        """Compute the sizes for a motion of a robot.

        Args:
            v: Rates, shape (T, nv).
            a: Accelerations, shape (T, nv); zero if None.
        """
        relative = np.abs(v / robot.unit)
        if robot.base != "fixed":
            relative[:, :3] = 0.0
        stated = np.zeros(len(v)) if a is None else np.abs(a / robot.unit).max(axis=1, initial=0.0)
        gravity = float(np.linalg.norm(robot.gravity))
        return cls(relative.max(axis=1, initial=0.0), stated, gravity)

    def rate(self, length: float) -> Array:
        """Compute the reference rate for the rounding of rates, shape (T,), [rad/s].

        It is the largest of the robot's rates, the rate of a pendulum and `SLOWEST`.

        Args:
            length: Length of the pendulum [m].
        """
        return np.maximum(self.speed, max(np.sqrt(self.gravity / length), SLOWEST))

    def acceleration(self, length: float) -> Array:
        """Compute the reference acceleration for the rounding of accelerations, shape (T,), [rad/s^2].

        Args:
            length: Length of the pendulum in `rate` [m].
        """
        return np.maximum(self.stated, self.rate(length) ** 2)


def robot_weight(robot: HybridRobot) -> float:
    """Return the weight of all bodies [N]."""
    mass = sum(body.mass for body in robot.bodies.bodies)
    return mass * float(np.linalg.norm(robot.gravity))


def natural_force(robot: HybridRobot, v: Array, a: Array) -> Array:
    """Compute the reference size of forces, as work per scaled coordinate.

    It is the torque that gives the robot's mass the reference acceleration at the distance of its size.

    Args:
        v: Rates, shape (T, nv).
        a: Accelerations, shape (T, nv).

    Returns:
        Shape (T,), [N m].
    """
    length = robot.bodies.size
    mass = sum(body.mass for body in robot.bodies.bodies)
    return mass * length**2 * NaturalSizes.of(robot, v, a).acceleration(length)


def force_rounding(robot: HybridRobot, v: Array, a: Array) -> Array:
    """Compute the rounding that may remain when forces cancel, shape (T,): one term for each freedom."""
    return NOISE * robot.nv * natural_force(robot, v, a)
