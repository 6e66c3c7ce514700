"""Check of tables for wrapped angles of joints whose positions count whole turns."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..errors import AT_SAMPLE, AssemblyError
from ..spatial import Array
from ..structure.robot import HybridRobot


def check_unwrapped(robot: HybridRobot, time: Array, joints: Mapping[str, tuple[Array, ...]]) -> None:
    """Check that positions of endless gears do not jump by whole turns against their velocities.

    Args:
        time: Times, shape (T,), [s].
        joints: Joint name to position, velocity and acceleration, shape (T,) each.

    Raises:
        AssemblyError: One jumps; the message names joint and sample.
    """
    for name in sorted(robot.description.endless_gears & joints.keys()):
        position, rate = joints[name][:2]
        step, turned = np.diff(position), np.diff(time) * (rate[1:] + rate[:-1]) / 2
        jumps = np.flatnonzero((np.abs(step) > np.pi) & (np.round((step - turned) / (2 * np.pi)) != 0))
        if len(jumps):
            i = int(jumps[0])
            raise AssemblyError(
                f"joint '{name}' goes by {step[i]:.3g} rad{AT_SAMPLE}, its velocity by "
                f"{turned[i]:.3g}: it is in a gear, so its position counts whole turns. Give positions that "
                "do (numpy.unwrap), or rows less than half a turn apart",
                sample=i + 1,
            )
