"""The programs of computed torque: from the motors' accelerations to those of all joints, then to efforts."""

from __future__ import annotations

import ctypes
from typing import TYPE_CHECKING

from ...effects.choice import Effects
from ...structure.robot import HybridRobot
from ..code.scalars import Scalar
from ..library.cache import Built
from ..library.compilers import best_lanes
from .sources import Artifact, robot_key

if TYPE_CHECKING:
    from ..code.library_source import Source


class TorquePrograms:
    """Programs "close" and "idm" of a robot whose motors determine its motion.

    "close" is used at closed postures only, and "idm" refuses accelerations that do not keep the loops
    closed; so "close" needs no verification of its own.

    Attributes:
        at: Addresses of the functions that run "close" and "idm" for one sample.
    """

    def __init__(self, closing: Built, models: Built) -> None:
        """Load the programs; they stay loaded as long as this object."""
        self._held = ctypes.PyDLL(str(closing.path)), ctypes.PyDLL(str(models.path))
        functions = self._held[0].close_single_at, self._held[1].idm_single_at
        close, idm = (ctypes.cast(function, ctypes.c_void_p).value or 0 for function in functions)
        self.at = close, idm


def closing_of_motors(robot: HybridRobot) -> Built | None:
    """Return the library of program "close" from the cache, or build it.

    Returns:
        The library; None if motors do not determine the motion.

    Raises:
        CompileError: It cannot be built.
    """
    scalar = Scalar("float64", best_lanes())

    def write() -> Source:
        """Generate the C source; it has no program where the motors do not determine the motion."""
        from ..code.library_source import library_source
        from ..equations.request import request
        from .close import close_program

        programs = [close_program(request(robot, None))] if _motors_determine(robot) else []
        return library_source(programs, scalar)

    built = Artifact(robot, f"close {robot_key(robot, None)} {scalar!r}", write).built()
    return built if "close" in built.about["programs"] else None


def same_without_limits(robot: HybridRobot, first: Effects, second: Effects) -> bool:
    """Return whether two choices of effects give the same inverse model, limits apart."""
    both = (on.only([name for name in on.names if name != "limits"]) for on in (first, second))
    one, other = (robot_key(robot, on) for on in both)
    return one == other


def _motors_determine(robot: HybridRobot) -> bool:
    """Return whether each module has as many motors as freedoms, and its closures leave them independent."""
    from ..equations.spanning import dependent_pivots, shape_of
    from .close import motor_freedoms

    driven = set(robot.motor_v.tolist())
    each = ((module, motor_freedoms(module, driven)) for module in robot.modules)
    for module, motors in {shape_of(*one): one for one in each}.values():
        if len(motors) != module.mobility:
            return False
        if module.mechanism.spanning_closures.rows and {*dependent_pivots([module], motors).cols} & {*motors}:
            return False
    return True
