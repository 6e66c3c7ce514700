"""Where quantities over joints or over motors stand in programs, which have an entry for every joint."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ...spatial import Array, Index
from ...structure.robot import HybridRobot
from ...structure.samples import as_batch
from .asking import everywhere
from .paths import MOTION


class CoordinatePlaces(NamedTuple):
    """Where quantities over some joints stand in programs.

    Attributes:
        joints: The joints' freedoms that are coordinates.
        every: Number of all freedoms.
        whole: Sizes of the quantities that are not over the coordinates, by name.
    """

    joints: Index
    every: int
    whole: Mapping[str, int]

    def width(self, name: str) -> int:
        """Return the size of a quantity over the coordinates."""
        return self.whole.get(name, len(self.joints))

    def spread(self, name: str, given: ArrayLike, samples: int, called: str) -> Array:
        """Return a quantity as programs read it, shape (samples, n), zero at other joints.

        Args:
            name: The quantity.
            given: Over the coordinates, for one or for every sample.
            samples: Number of samples.
            called: What messages call it.

        Raises:
            TrajectoryError: It has a wrong shape, or is not finite.
        """
        rows, _ = as_batch(given, self.width(name), called)
        own = everywhere(rows, samples)
        if name in self.whole:
            return own
        out = np.zeros((samples, self.every))
        out[:, self.joints] = own
        return out

    def own(self, name: str, found: Array) -> Array:
        """Return a quantity that a program found, over the coordinates."""
        return found if name in self.whole else found[:, self.joints]


def places_of(robot: HybridRobot, coordinates: str) -> CoordinatePlaces:
    """Return the places of quantities over "joints" or over "motors"."""
    joints = robot.motor_v if coordinates == "motors" else np.arange(robot.nv)
    return CoordinatePlaces(joints, robot.nv, {"tau": len(robot.motors), MOTION: robot.nq + 2 * robot.nv})
