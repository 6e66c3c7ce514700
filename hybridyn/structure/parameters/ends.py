"""Limits of joints at which stops begin: designs of one model have them in common."""

from collections.abc import Iterable

from ...description.records import Description
from ...errors import ModelError
from ..robot import HybridRobot


def check_ends(robot: HybridRobot, other: Description, ends: Iterable[tuple[str, str]]) -> None:
    """Check that stops begin in another design where they do in the robot.

    Args:
        ends: Joints, and which of their limits stops take from the robot's files, as `Effects.ends`.

    Raises:
        ModelError: A limit differs.
    """
    joints = {one.name: one for one in other.joints}
    for name, word in ends:
        own, theirs = (getattr(of[name], word) for of in (robot.records, joints))
        if own != theirs:
            raise ModelError(
                f"the limit '{word}' of joint '{name}' is {theirs:g} instead of {own:g}, where the effect "
                f"'stop' begins: models take it as constant. Give the stop '{word}' of its own there",
                element=name,
            )
