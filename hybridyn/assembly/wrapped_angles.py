"""Check of tables for wrapped angles of joints whose whole turns determine the position of a gear."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..errors import AssemblyError
from ..linkage.gears import turns_decide
from ..spatial import Array
from ..structure.robot import HybridRobot


def check_unwrapped(robot: HybridRobot, time: Array, joints: Mapping[str, tuple[Array, ...]]) -> None:
    """Check that positions of geared continuous joints do not jump by whole turns against their velocities.

    Args:
        time: Times, shape (T,), [s].
        joints: Joint name to position, velocity and acceleration, shape (T,) each.

    Raises:
        AssemblyError: One jumps; the message names joint and sample.
    """
    endless = {name for name, kind in zip(robot.joints, robot.kinds, strict=True) if kind == "continuous"}
    for coupling in robot.description.couplings:
        terms = [(name, weight) for name, weight in coupling.terms if name in endless]
        given = [weight for name, weight in terms if name in joints]
        if all(name in joints for name, _ in coupling.terms):
            continue
        if not turns_decide([weight for name, weight in terms if name not in joints], given):
            continue
        for name in (name for name, _ in terms if name in joints):
            position, rate = joints[name][:2]
            step, turned = np.diff(position), np.diff(time) * (rate[1:] + rate[:-1]) / 2
            jumps = np.flatnonzero((np.abs(step) > np.pi) & (np.round((step - turned) / (2 * np.pi)) != 0))
            if len(jumps):
                i = int(jumps[0])
                raise AssemblyError(
                    f"joint '{name}' goes by {step[i]:.3g} rad at sample {i + 1}, its velocity by "
                    f"{turned[i]:.3g}: its turns decide where gear '{coupling.name}' stands. Give positions "
                    "that count whole turns (numpy.unwrap), or rows less than half a turn apart",
                    sample=i + 1,
                )
