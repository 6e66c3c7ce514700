"""The position of one joint within q, and those of all joints by name."""

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


def positions(robot: HybridRobot, q: Array) -> dict[str, tuple[float, ...]]:
    """Return the position of each joint of a posture as `model.toml` states it; a free base is left out.

    Args:
        q: Positions on the spanning tree, shape (nq,).

    Returns:
        By joint one number (an angle for a continuous joint), or Pinocchio's coordinates.
    """
    out: dict[str, tuple[float, ...]] = {}
    for name, kind, at in zip(robot.joints, robot.kinds, robot.q_slices, strict=True):
        if kind == "continuous":
            out[name] = (float(joint_position(robot, q, name)),)
        elif robot.base == "fixed" or name != robot.joints[0]:
            out[name] = tuple(float(value) for value in q[at])
    return out
