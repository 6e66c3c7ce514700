"""Names in a partial pose, and complete orientations of a link.

An orientation is given by roll, pitch and yaw, by a quaternion, or by a rotation vector; in part by an
angle, or by the direction of an axis.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from ..errors import TrajectoryError
from ..joints.kinds import LENGTHS, QUATERNION, SPIN
from ..linkage.angles import angular_drift, angular_map, rotation_from_angles
from ..linkage.motion import Motion
from ..linkage.targets import COORDINATES
from ..spatial import Array, rotate, rotation_from_quaternion, rotation_from_vector
from ..structure.samples import UNIT
from ..tables.signals import (
    ANGLES,
    CENTRE,
    DIRECTIONS,
    DISTANCE,
    FURTHER,
    VECTOR,
)

#: All names in a partial pose.
PLACES = (*COORDINATES, *QUATERNION, *VECTOR, *FURTHER)
#: Directions shorter than this have lost their digits.
NO_DIRECTION = 1e-6


def rate_names(places: Iterable[str], key: str) -> tuple[str, ...]:
    """Return the names of the rates of the coordinates in a partial pose: those of a turn are wx, wy, wz.

    Raises:
        TrajectoryError: An orientation, a direction or a distance is incomplete, or given twice.
    """
    names = tuple(places)
    axes = [group for group in DIRECTIONS.values() if set(group) & set(names)]
    turns = [group for group in (ANGLES, QUATERNION, VECTOR) if set(group) & set(names)]
    partial = not set(ANGLES) <= set(names) and turns in ([], [ANGLES])
    if len(turns) > 1 or len(axes) > 1 or (axes and not partial):
        twice = " and ".join(", ".join(group) for group in (*turns, *axes))
        raise TrajectoryError(f"the orientation of '{key}' is given twice, by {twice}", column=key)
    centre = [(DISTANCE, *CENTRE)] if set(CENTRE) & set(names) else []
    for group in (*(turn for turn in turns if turn is not ANGLES), *axes, *centre):
        if missing := [name for name in group if name not in names]:
            what = "distance" if DISTANCE in group else "direction" if group in axes else "orientation"
            raise TrajectoryError(
                f"the {what} of '{key}' lacks {', '.join(missing)}: it takes {', '.join(group)}", column=key
            )
    spin = SPIN if turns and turns[0] is not ANGLES else ()
    return (*(name for name in names if name in (*COORDINATES, *FURTHER)), *spin)


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


def direction_of(coordinates: Mapping[str, Array], key: str) -> tuple[int, Array] | None:
    """Return the number of the axis whose direction is among coordinates, and the direction, shape (3, T, 3).

    Directions of any length are made to have length one, with the rates that these then have.

    Raises:
        TrajectoryError: One has no length.
    """
    for i, names in enumerate(DIRECTIONS.values()):
        if names[0] in coordinates:
            d, d_dot, d_ddot = np.stack([coordinates[name] for name in names], axis=-1)
            length = np.linalg.norm(d, axis=1)[:, None]
            if len(bad := np.flatnonzero(~(length[:, 0] >= NO_DIRECTION))):
                raise TrajectoryError(
                    f"direction of length {length[bad[0], 0]:.3g} (at least {NO_DIRECTION:g}): give a longer",
                    row=int(bad[0]) + 1,
                    column=key,
                )
            unit = d / length
            growth = np.sum(unit * d_dot, axis=1)[:, None]
            rate = (d_dot - growth * unit) / length
            # A component along the direction does not count.
            return i, np.stack([unit, rate, (d_ddot - 2.0 * growth * rate) / length])
    return None


def distance_of(coordinates: Mapping[str, Array], key: str) -> tuple[Array, Array] | None:
    """Return the distance among coordinates, shape (3, T), and the point it is from, shape (3, T, 3).

    Raises:
        TrajectoryError: It is not positive.
    """
    if DISTANCE not in coordinates:
        return None
    levels = coordinates[DISTANCE]
    if len(bad := np.flatnonzero(~(levels[0] > 0.0))):
        raise TrajectoryError(
            f"distance {levels[0, bad[0]]:.3g} m: it must be positive; to reach a point give x, y, z",
            row=int(bad[0]) + 1,
            column=key,
        )
    still = np.zeros_like(levels)
    return levels, np.stack([coordinates.get(name, still) for name in CENTRE], axis=-1)


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
