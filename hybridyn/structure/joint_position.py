"""The position of one joint within q."""

from __future__ import annotations

import numpy as np

from ..spatial import Array
from .robot import HybridRobot


def joint_position(robot: HybridRobot, q: Array, joint: str) -> Array:
    """Return the position of a joint with one freedom; for a continuous joint the angle in [-pi, pi].

    Args:
        q: Positions of the spanning tree, shape (..., nq).
        joint: Name of the joint.

    Returns:
        Shape (...), [m or rad].
    """
    x = q[..., robot.q_slices[robot.joint_index[joint]]]
    return x[..., 0] if x.shape[-1] == 1 else np.arctan2(x[..., 1], x[..., 0])
