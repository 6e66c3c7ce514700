"""The map between motors and output joints at many postures, some of which may be singular."""

from __future__ import annotations

from collections.abc import Sequence

from ...errors import SingularityError
from ...spatial import Array
from ...structure.robot import HybridRobot
from .joint_map import JointMap, joint_map


def regular_map(robot: HybridRobot, q: Array, joints: Sequence[str]) -> tuple[JointMap | None, list[int]]:
    """Compute the map at the postures that are not singular.

    Args:
        q: Positions, shape (T, nq).

    Returns:
        The map, or None if no posture is left, and the samples that are.

    Raises:
        SingularityError: The joints do not fit the modules, whatever the posture.
    """
    found, kept = _regular(robot, q, joints, list(range(len(q))))
    if found is None and kept:
        found = joint_map(robot, q[kept], joints)
    return found, kept


def _regular(
    robot: HybridRobot, q: Array, joints: Sequence[str], samples: list[int]
) -> tuple[JointMap | None, list[int]]:
    """Return those of some samples that are not singular, and their map if it is all of them.

    An error names one singular sample: it is dropped, and the halves of the others are computed apart. The
    work grows with T log T at most, whatever the number of singular samples.
    """
    if not samples:
        return None, []
    try:
        return joint_map(robot, q[samples], joints), samples
    except SingularityError as error:
        if error.sample is None or error.what == "independent coordinates":
            raise
        rest = samples[: error.sample] + samples[error.sample + 1 :]
    half = len(rest) // 2
    return None, [i for part in (rest[:half], rest[half:]) for i in _regular(robot, q, joints, part)[1]]
