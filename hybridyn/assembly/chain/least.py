"""The rule by which a chain with more freedoms than are given moves: its motors move least.

A motor's motion is measured by its range, so that motors with little stroke are spared. A joint that turns
without limits is measured by a turn, a slide without limits by the length of its module.
"""

from collections.abc import Mapping

import numpy as np

from ...spatial import Array
from ...structure.module import Module
from ...structure.robot import HybridRobot
from ..free_motions import free_motions

#: Joints without a motor count by this part of what they move [rad, module lengths]: near a posture where the
#: motors lose a direction, they keep the motion small.
PASSIVE = 1e-3


def driven_alone(module: Module) -> bool:
    """Return whether motors drive all motions of a module, idle ones apart."""
    return module.driven >= module.mobility or not free_motions(module).uncontrolled


def ease_of(robot: HybridRobot, module: Module, weights: Mapping[str, float]) -> Array:
    """Return the motion of each freedom of a module that counts as one, in its unit, shape (n,).

    In a module that its motors do not drive alone, spins of rods apart, all freedoms count alike.

    Args:
        weights: Motor to the factor of its motion; 1 for others.
    """
    m, alone = module.mechanism, driven_alone(module)
    out = np.full(m.tree.nv, 1.0 / PASSIVE if alone else 1.0)
    for name, column in zip(module.motors, module.motor_columns, strict=True):
        joint = robot.records[name]
        whole = m.length if joint.kind.slides else 2.0 * np.pi
        span = joint.upper - joint.lower
        if alone:
            out[column] = (span if 0.0 < span < np.inf else whole) / m.reduction.col_scale[column]
        out[column] /= weights.get(name, 1.0)
    return out
