"""Robots with other numbers in some slots of their description."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from ..building import build_robot
from ..robot import HybridRobot
from .slots import Slot, with_values


def changed(robot: HybridRobot, slots: Sequence[Slot], values: Iterable[float]) -> HybridRobot:
    """Build a robot with other numbers in slots of its description.

    Args:
        robot: The robot.
        slots: The slots.
        values: Their numbers.

    Raises:
        ModelError: The numbers are no robot, or the rank of a module's closures is in doubt.
        AssemblyError: No posture closes the loops of a module.
    """
    return build_robot(
        with_values(robot.description, slots, values), base=robot.base, gravity=robot.gravity,
        rank_tolerance=robot.rank_tolerance, closure_tolerance=robot.closure_tolerance, held=robot.held,
        payloads=robot.payloads,
    )  # fmt: skip
