"""Complete orientations of a link: by roll, pitch and yaw, by a quaternion, or by a rotation vector."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from ..errors import TrajectoryError
from ..linkage.angles import angular_drift, angular_map, rotation_from_angles
from ..linkage.targets import COORDINATES
from ..linkage.tree import Motion
from ..spatial import Array, rotate, rotation_from_quaternion, rotation_from_vector
from ..structure.samples import UNIT

LENGTHS, ANGLES = COORDINATES[:3], COORDINATES[3:]
QUATERNION, VECTOR, SPIN = ("qx", "qy", "qz", "qw"), ("rx", "ry", "rz"), ("wx", "wy", "wz")
#: All names in a partial pose.
PLACES = (*COORDINATES, *QUATERNION, *VECTOR)


def rate_names(places: Iterable[str], key: str) -> tuple[str, ...]:
    """Return the names of the rates of the coordinates in a partial pose: those of a turn are wx, wy, wz.

    Raises:
        TrajectoryError: An orientation is incomplete, or given twice.
    """
    names = tuple(places)
    turns = [group for group in (ANGLES, QUATERNION, VECTOR) if set(group) & set(names)]
    if len(turns) > 1:
        raise TrajectoryError(
            f"the orientation of '{key}' is given twice, by {' and '.join(', '.join(g) for g in turns)}",
            column=key,
        )
    for group in turns:
        missing = [name for name in group if name not in names]
        if group is not ANGLES and missing:
            raise TrajectoryError(
                f"the orientation of '{key}' lacks {', '.join(missing)}: it takes {', '.join(group)}",
                column=key,
            )
    whole = turns and turns[0] is not ANGLES
    return (*(name for name in names if name in COORDINATES), *(SPIN if whole else ()))


def turn_of(coordinates: Mapping[str, Array], key: str) -> Motion | None:
    """Return the motion of a link whose complete orientation is among its coordinates, or None.

    Args:
        coordinates: Name to value, rate and acceleration, shape (3, T); `SPIN` has rates only.
        key: The link, for messages.

    Raises:
        TrajectoryError: A quaternion is not of unit length.
    """

    def of(names: Iterable[str], level: int) -> Array:
        """Return some coordinates, zero where they are not given, shape (T, names)."""
        T = next(iter(coordinates.values())).shape[1]
        zero = np.zeros((3, T))
        return np.stack([coordinates.get(name, zero)[level] for name in names], axis=1)

    if set(ANGLES) <= set(coordinates):
        angles, rates = of(ANGLES, 0), of(ANGLES, 1)
        R = rotation_from_angles(angles)
        E = angular_map(R, angles)
        w, w_dot = rotate(E, rates), rotate(E, of(ANGLES, 2)) + angular_drift(E, rates)
    elif "qw" in coordinates or "rx" in coordinates:
        if "qw" in coordinates:
            quaternions = of(QUATERNION, 0)
            check_unit(quaternions, key)
            R = rotation_from_quaternion(quaternions)
        else:
            R = rotation_from_vector(of(VECTOR, 0))
        w, w_dot = of(SPIN, 1), of(SPIN, 2)
    else:
        return None
    p, p_dot, p_ddot = (of(LENGTHS, level) for level in range(3))
    return Motion(R, p, w, p_dot, w_dot, p_ddot)


def check_unit(quaternions: Array, key: str) -> None:
    """Raise if a quaternion, shape (T, 4), is not of unit length; the error names the first one's sample."""
    norm = np.linalg.norm(quaternions, axis=1)
    bad = np.flatnonzero(np.abs(norm - 1) > UNIT)
    if len(bad):
        raise TrajectoryError(
            f"quaternion of length {norm[bad[0]]:.9g} (must be 1 to {UNIT:g})",
            row=int(bad[0]) + 1,
            column=key,
        )
