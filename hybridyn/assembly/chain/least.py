"""The rule by which a chain with more freedoms than are given moves: its motors move least.

A motor's motion is measured by its range, so that motors with little stroke are spared. A joint that turns
without limits is measured by a turn, a slide without limits by the length of its module.
"""

import numpy as np

from ...spatial import Array
from ...structure.module import Module
from ...structure.robot import HybridRobot

#: Joints without a motor count by this part of what they move [rad, module lengths]: near a posture where the
#: motors lose a direction, they keep the motion small.
PASSIVE = 1e-3


def ease_of(robot: HybridRobot, module: Module) -> Array:
    """Return the motion of each freedom of a module that counts as one, in its unit, shape (n,).

    In a module that its motors do not drive alone, all freedoms count alike.
    """
    m = module.mechanism
    if module.driven < module.mobility:
        return np.ones(m.tree.nv)
    out = np.full(m.tree.nv, 1.0 / PASSIVE)
    for name, column in zip(module.motors, module.motor_columns, strict=True):
        joint = robot.records[name]
        whole = m.length if joint.kind == "prismatic" else 2.0 * np.pi
        span = joint.upper - joint.lower
        out[column] = (span if 0.0 < span < np.inf else whole) / m.reduction.col_scale[column]
    return out
