"""Ask whether numbers of a table are in degrees or millimetres, where they look like it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ..tables.signals import unit_of

if TYPE_CHECKING:
    from ..description.records import Joint
    from ..structure.robot import HybridRobot
    from ..tables.trajectory import Motion

#: Angle that a joint without limits hardly has [rad].
TURNS = 4 * math.pi


def other_unit(joint: Joint, position: float, size: float) -> str:
    """Return the question whether a position has another unit: "degrees?", "millimetres?" or "".

    It has if it is as many times beyond the limits as the square root of the ratio of the two units.

    Args:
        joint: A joint with one freedom.
        position: Its position [m or rad].
        size: Size of the robot, for slides without limits [m].
    """
    slides = joint.kind == "prismatic"
    bound, ratio = (size, 1e3) if slides else (TURNS, 180 / math.pi)
    if joint.lower < joint.upper and math.isfinite(joint.upper - joint.lower):
        bound = max(abs(joint.lower), abs(joint.upper))
    if abs(position) <= bound * math.sqrt(ratio):
        return ""
    return "millimetres?" if slides else "degrees?"


def question(robot: HybridRobot, motion: Motion) -> str:
    """Return the question about the unit of a motion that cannot be assembled, with a number, or ""."""
    size = robot.bodies.size
    for name, (position, *_) in motion.joints.items():
        joint, column = robot.records[name], np.ravel(position)
        worst = float(column[np.argmax(np.abs(column))])
        if asked := other_unit(joint, worst, size):
            limits = f"(limits {joint.lower:g} and {joint.upper:g})"
            return f". '{name}' goes to {worst:g} {unit_of(joint.kind)} {limits}: {asked}"
    for name, (pose, *_) in motion.platforms.items():
        part = [pose[word] for word in "xyz" if word in pose] if isinstance(pose, dict) else pose[..., :3]
        far = float(np.abs(part).max(initial=0.0))
        if far > size * math.sqrt(1e3):
            return f". '{name}' goes to {far:g} m, and the robot's size is {size:.3g} m: millimetres?"
    return ""
