"""The forms in which a caller may give motors and poses: by name, as arrays in order, as matrices."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..errors import TrajectoryError
from ..spatial import Array, quaternion_from_rotation
from ..tables.named_columns import is_table, named_motion
from .robot import HybridRobot
from .samples import UNIT, as_numbers


def by_name(wanted: Any) -> Mapping[str, object]:
    """Return a mapping from name to value of a mapping or a table with named columns (a DataFrame)."""
    return named_motion(wanted) if is_table(wanted) else wanted or {}


def motors_by_name(robot: HybridRobot, motors: Any) -> Mapping[str, object]:
    """Return the positions of motors by name, also of arrays in the order of the motors, see `assemble`.

    Raises:
        TrajectoryError: An array has another number of columns than the robot has motors.
    """
    if is_table(motors):
        return named_motion(motors, robot.motors)
    if motors is None or isinstance(motors, Mapping):
        return by_name(motors)
    n, parts = len(robot.motors), []
    levels = isinstance(motors, tuple) and any(isinstance(x, Sequence) or np.ndim(x) for x in motors)
    for level in triple(motors if levels else (motors,)):
        part = as_numbers(np.zeros(n) if level is None else level, "motors")
        if part.ndim not in (1, 2) or part.shape[-1] != n:
            raise TrajectoryError(
                f"motors has shape {part.shape}; wanted ({n},) or (T, {n}), as robot.motors, or a mapping "
                f"such as {{{robot.motors[0] if n else 'name'!r}: 0.1}}"
            )
        parts.append(part)
    return {name: tuple(part[..., i] for part in parts) for i, name in enumerate(robot.motors)}


def triple(value: object) -> tuple[object, object, object]:
    """Return (position, rate, acceleration), None where omitted."""
    parts = list(value) if isinstance(value, (tuple, list)) else [value]
    if not 1 <= len(parts) <= 3:
        raise TrajectoryError("give (position, rate, acceleration), of which the last two may be left out")
    parts += [None] * (3 - len(parts))
    return parts[0], parts[1], parts[2]


def pose_numbers(key: str, pose: object) -> Array:
    """Return a pose as x, y, z, qx, qy, qz, qw; it may be a matrix, shape (..., 4, 4), or a `pin.SE3`."""
    out = as_numbers(getattr(pose, "homogeneous", pose), f"the pose of '{key}'")
    if out.shape[-2:] != (4, 4):
        return out
    R, below = out[..., :3, :3], (out[..., 3, :] == [0.0, 0.0, 0.0, 1.0]).all()
    if not (
        below and np.allclose(R @ R.swapaxes(-1, -2), np.eye(3), 0, UNIT) and (np.linalg.det(R) > 0).all()
    ):
        raise TrajectoryError(
            "its matrix is no placement: three axes of a right-handed frame, the origin in the last column, "
            "and 0 0 0 1 in the last row",
            column=key,
        )
    return np.concatenate([out[..., :3, 3], quaternion_from_rotation(R)], axis=-1)
