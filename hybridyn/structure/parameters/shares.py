"""Shares of motors in a load: ratios of their effort limits, which designs of one model have in common."""

from collections.abc import Sequence

import numpy as np

from ...description.records import Description, Joint
from ...errors import ModelError
from ...spatial import Array
from ..robot import HybridRobot

#: Largest change of a ratio of limits, which expressions in files round.
SAME_RATIO = 1e-12


def check_shares(robot: HybridRobot, other: Description) -> None:
    """Check that motors which share a load share it in another design as they do in the robot.

    Raises:
        ModelError: The ratios of their effort limits differ.
    """
    joints = {one.name: one for one in other.joints}
    for module in robot.modules:
        names = [module.motors[i] for i in module.moving_motors]
        if len(names) <= module.driven:
            continue
        own, theirs = (_ratios([of[name] for name in names]) for of in (robot.records, joints))
        off = np.abs(own - theirs)
        if off.max() > SAME_RATIO:
            raise ModelError(
                f"module '{module.name}': {len(names)} motors share a load by their effort limits, whose "
                f"ratios differ by {off.max():.1e} in this design: models take them as constant. "
                "State limits whose ratios stay, or load a robot of each design",
                element=names[int(off.argmax())],
            )


def _ratios(motors: Sequence[Joint]) -> Array:
    """Return the effort limits of motors over the largest; ones where one has no limit."""
    limits = np.array([motor.effort_limit for motor in motors])
    return limits / limits.max() if np.isfinite(limits).all() else np.ones(len(limits))
