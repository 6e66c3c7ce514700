"""Signals: the joints and poses of a table, with the columns of position and rates."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import NamedTuple

import numpy as np

from ..description.records import Array, Joint
from ..errors import TrajectoryError
from ..joints.kinds import LENGTHS, QUATERNION, SPIN, YAW, JointKind, Turn

ANGLES = ("roll", "pitch", YAW)
COORDINATES = (*LENGTHS, *ANGLES)
#: A complete orientation, whose rates are `SPIN` like those of a quaternion: a unit axis times its angle.
VECTOR = ("rx", "ry", "rz")
#: Directions of a link's axes, by components in the other link; rates are the derivatives of these.
DIRECTIONS = {axis: (f"{axis}x", f"{axis}y", f"{axis}z") for axis in LENGTHS}
#: Distance of a link's origin from a point of the other link: its origin, or that with these coordinates.
DISTANCE, CENTRE = "distance", ("cx", "cy", "cz")
#: What a partial pose may prescribe beside coordinates and an orientation.
FURTHER = (*(part for names in DIRECTIONS.values() for part in names), DISTANCE, *CENTRE)
POSE, TWIST = (*LENGTHS, *QUATERNION), (*LENGTHS, *SPIN)
RATES = ("velocity", "acceleration")
#: The reference in which a moving or floating base moves: the root link's frame of a fixed one.
WORLD = "world"
WRENCH = ("fx", "fy", "fz", "mx", "my", "mz")

#: Units of quantities of a joint that slides, and of one that turns.
UNITS = {
    "position": ("m", "rad"), "velocity": ("m/s", "rad/s"), "acceleration": ("m/s^2", "rad/s^2"),
    "effort": ("N", "N m"), "speed": ("m/s", "rad/s"), "power": ("W", "W"),
}  # fmt: skip


def joint_columns(joint: str, kind: JointKind, quantity: str) -> list[str]:
    """Return the columns of a joint's position, velocity or acceleration, by components if it has several."""
    parts = kind.places if quantity == "position" else kind.rates
    return [f"{joint}/{quantity}/{part}".rstrip("/") for part in parts]


def unit_of(kind: JointKind, quantity: str = "position") -> str:
    """Return the unit of a quantity of a joint with one freedom, by its kind."""
    return UNITS[quantity][not kind.slides]


class Signal(NamedTuple):
    """A joint or a pose, with the columns of its numbers.

    Attributes:
        name: Joint, or link as in the header (`link`, `link@other`).
        components: Names of the position's components; ("",) for a joint with one freedom.
        position: Column of each component.
        velocity: Columns of the rates, or None where the table does not have them.
        acceleration: Columns of their derivatives, or None.
        wraps: Indices of the components that are angles without bounds.
        wanted: Rates that the reader of the table uses; other missing rates are zero.
    """

    name: str
    components: tuple[str, ...]
    position: tuple[int, ...]
    velocity: tuple[int, ...] | None
    acceleration: tuple[int, ...] | None
    wraps: tuple[int, ...] = ()
    wanted: tuple[str, ...] = RATES

    @property
    def missing(self) -> tuple[str, ...]:
        """Names of the wanted rates that the table does not have."""
        given = {"velocity": self.velocity, "acceleration": self.acceleration}
        return tuple(name for name in self.wanted if given[name] is None)

    @property
    def turn(self) -> tuple[str, ...]:
        """Names of a complete orientation whose rates are those of `SPIN`, or none."""
        return next((names for names in (QUATERNION, VECTOR) if names[0] in self.components), ())

    @property
    def lacks(self) -> str:
        """Component that a whole pose with an orientation of `turn` has and this one lacks, or ""."""
        missing = (name for name in LENGTHS if name not in self.components)
        return next(missing, "") if self.turn else "qx"

    @property
    def lengths(self) -> int:
        """Number of components before those of the orientation, if its rates are those of `SPIN`."""
        return len(self.components) - len(self.turn)


def read_signal(
    name: str, joint: Joint | None, given: dict[str, dict[str, int]], file: str | None,
    wanted: tuple[str, ...] = RATES, *, endless: bool = False,
) -> Signal:  # fmt: skip
    """Build the signal of a joint, or of a pose: a complete orientation, some of its coordinates, or both.

    Args:
        name: The joint, or the link as in the header.
        joint: The joint, or None for a pose.
        given: Columns by quantity and component.
        file: Path of the table, for messages.
        wanted: The needed ones of "velocity" and "acceleration".
        endless: Whether the joint is a gear that turns without limits.

    Raises:
        TrajectoryError: A component is missing or unknown, or rates that cannot be fitted are missing.
    """
    pose = given.get("pose", {})
    kind = JointKind.FLOATING if joint is None else joint.kind
    places, rates = kind.places, kind.rates
    by = "quaternion"
    if pose:
        places, rates, by = _parts_of_pose(pose)
    what = f"the pose of '{name}' by its {by}" if joint is None else f"joint '{name}' ({joint.kind})"
    first = "pose" if joint is None else "position"
    at = {
        quantity: picked(given.get(quantity, {}), parts, f"{name}/{quantity}", what, file)
        for quantity, parts in ((first, places), ("velocity", rates), ("acceleration", rates))
        if quantity == first or quantity in given
    }
    wraps = [
        i for i, part in enumerate(places) if part in ANGLES or endless or (joint and joint.kind.endless)
    ]
    signal = Signal(name, places, at[first], at.get("velocity"), at.get("acceleration"), tuple(wraps), wanted)
    if joint is not None and len(places) > 1 and signal.missing:
        message = f"is missing: rates of a {joint.kind} joint are not fitted"
        raise TrajectoryError(message, file=file, column=f"{name}/{signal.missing[0]}/{rates[0]}")
    return signal


def _parts_of_pose(pose: Collection[str]) -> tuple[tuple[str, ...], tuple[str, ...], str]:
    """Return the components of a pose that has some columns, those of its rates, and how it is given."""
    lengths, angles = (tuple(name for name in names if name in pose) for names in (LENGTHS, ANGLES))
    groups = (*DIRECTIONS.values(), CENTRE, (DISTANCE,) if set(CENTRE) & set(pose) else ())
    whole = {name for group in groups if set(group) & set(pose) for name in group} | {*pose}
    further = tuple(name for name in FURTHER if name in whole)
    for turn, by in ((QUATERNION, "quaternion"), (VECTOR, "rotation vector")):
        if set(turn) & set(pose):
            return (*further, *lengths, *turn), (*further, *lengths, *SPIN), by
    places = (*further, *lengths, *angles) or COORDINATES
    return places, places, "coordinates"


def picked(
    given: dict[str, int], names: Sequence[str], prefix: str, what: str, file: str | None
) -> tuple[int, ...]:
    """Return the columns of exactly these components.

    Raises:
        TrajectoryError: One is unknown or missing.
    """
    unknown = [name for name in given if name not in names]
    for name in [*unknown, *(name for name in names if name not in given)]:
        wrong = "does not belong here" if name in unknown else "is missing"
        expected = ", ".join(f"{prefix}/{part}".rstrip("/") for part in names)
        message = f"{wrong}: {what} takes {expected}"
        raise TrajectoryError(message, file=file, column=f"{prefix}/{name}".rstrip("/"))
    return tuple(given[name] for name in names)


def on_circles(kind: JointKind, positions: Array) -> Array:
    """Replace the angle of a continuous or a planar joint by its cosine and sine, shape (T, its nq)."""
    if kind.turn is not Turn.CIRCLE:
        return positions
    angle = positions[:, -1:]
    return np.hstack([positions[:, :-1], np.cos(angle), np.sin(angle)])
