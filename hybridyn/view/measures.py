"""Distance of a posture from singularities, and the efforts that hold it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..dynamics.inverse import idm
from ..errors import HybridynError
from ..simulation.events import near_singularity
from ..spatial import Array
from ..structure.robot import HybridRobot

#: Closeness below which a posture is reported as near a singularity, and as singular.
NEAR_SINGULAR, AT_SINGULAR = 1e-2, 1e-3


@dataclass(frozen=True)
class Closeness:
    """Distances from singularities: smallest over largest singular value, 0 where rank is lost.

    Attributes:
        closures: Distance for the closure Jacobian; 1 if there are no closures.
        motors: Distance for the motors' rows of the motion basis; 1 if there are no motors.
    """

    closures: float
    motors: float

    @property
    def least(self) -> float:
        """The smaller of the two distances."""
        return min(self.closures, self.motors)


class Measures:
    """Measures of a robot's postures. Data shared by all postures are computed once."""

    def __init__(self, robot: HybridRobot) -> None:
        self.robot = robot
        kinds = ("closures", "motors")
        self._functions = [near_singularity(robot, 0.0, what=what).function for what in kinds]

    def closeness(self, q: Array) -> Closeness:
        """Compute the distances of a posture, shape (nq,), from singularities."""
        still = np.zeros(self.robot.nv)
        closures, motors = (float(function(0.0, q, still)) for function in self._functions)
        return Closeness(max(closures, 0.0), max(motors, 0.0))

    def holding(self, q: Array) -> tuple[Array | None, str]:
        """Compute the efforts that hold a posture at rest.

        Args:
            q: The posture, shape (nq,).

        Returns:
            Efforts, shape (motors,), [N or N m], or None, and the reason if None.
        """
        if not self.robot.motors:
            return None, "there are no motors"
        still = np.zeros(self.robot.nv)
        try:
            return idm(self.robot, q, still, still), ""
        except HybridynError as error:
            return None, str(error).partition(". ")[0]
