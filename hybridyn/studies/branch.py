"""Name the assembly branch of a robot, which most commands tell, by the joint that tells it best."""

from __future__ import annotations

import numpy as np

from ..joints.kinds import JointKind
from ..spatial import Array
from ..structure.robot import HybridRobot, positions
from ..tables.signals import unit_of


def branch(robot: HybridRobot) -> list[str]:
    """Return one line that names the assembly branch; none if all joints of the loops are zero at home."""
    far = far_from_zero(robot)
    return [f"assembly branch: that of the home posture, {far}"] if far else []


def far_from_zero(robot: HybridRobot) -> str:
    """Name the joint of a loop that is farthest from zero at home; return "" if all are zero."""
    loops = {closure.name for closure in robot.description.closures}
    looped = {name for module in robot.modules if loops & {*module.closures} for name in module.joints}
    if not looped:
        return ""
    zero = np.concatenate([kind.zero for kind in robot.kinds])
    distances = distances_from(robot, zero, robot.home)
    joint = max((name for name in distances if name in looped), key=lambda name: distances[name], default="")
    if not joint or distances[joint] == 0.0:
        return ""
    unit = unit_of(robot.kinds[robot.joint_index[joint]])
    return f"in which '{joint}' is farthest from zero ({distances[joint]:.3g} {unit})"


def distances_from(robot: HybridRobot, reference: Array, q: Array) -> dict[str, float]:
    """Return how far each joint of a posture, shape (nq,), is from another posture [m or rad]."""
    here, home = positions(robot, q), positions(robot, reference)
    kinds = dict(zip(robot.joints, robot.kinds, strict=True))
    out = {}
    for name, values in here.items():
        a, b = np.array(values), np.array(home[name])
        if kinds[name] is JointKind.SPHERICAL:
            out[name] = 2 * float(np.arccos(min(1.0, abs(float(a @ b)))))
        elif kinds[name].endless:
            out[name] = abs(float(np.angle(np.exp(1j * (a[0] - b[0])))))
        else:
            out[name] = float(np.abs(a - b).max())
    return out
