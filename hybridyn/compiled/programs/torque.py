"""The programs of computed torque: from the motors' accelerations to those of all joints, then to efforts."""

from __future__ import annotations

import ctypes

from ...dynamics.quantities.independent import located
from ...effects.choice import Effects
from ...structure.robot import HybridRobot
from ..library.cache import Built
from .quantities.following import artifact_of
from .sources import robot_key

#: What a warning says that is done without a library.
IN_PYTHON = "computed torque is evaluated in Python, which takes longer"


class TorquePrograms:
    """Programs "following" and "idm" of a robot whose motors determine its motion.

    Attributes:
        at: Addresses of the functions that run them for one sample.
    """

    def __init__(self, closing: Built, models: Built) -> None:
        """Load the programs; they stay loaded as long as this object."""
        self._held = ctypes.PyDLL(str(closing.path)), ctypes.PyDLL(str(models.path))
        functions = self._held[0].following_single_at, self._held[1].idm_single_at
        close, idm = (ctypes.cast(function, ctypes.c_void_p).value or 0 for function in functions)
        self.at = close, idm


def closing_of_motors(robot: HybridRobot) -> Built | None:
    """Return the library of the motions over the motors from the cache, or build it.

    Returns:
        The library; None if motors do not determine the motion, or, with a warning, if it cannot be built.
    """
    u = located(robot, robot.motors, chosen=False)
    if any(len(own) != m.mobility for m, own in zip(robot.modules, u.own, strict=True)):
        return None
    return artifact_of(robot, u, "float64").tried(lambda built: built, IN_PYTHON)


def same_without_limits(robot: HybridRobot, first: Effects, second: Effects) -> bool:
    """Return whether two choices of effects give the same inverse model, limits apart."""
    both = (on.only([name for name in on.names if name != "limits"]) for on in (first, second))
    one, other = (robot_key(robot, on) for on in both)
    return one == other
