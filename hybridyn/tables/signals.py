"""Signals: the joints and poses of a table, with the columns of position and rates."""

from __future__ import annotations

from typing import NamedTuple

from ..description.records import Joint
from ..errors import TrajectoryError

POSE = ("x", "y", "z", "qx", "qy", "qz", "qw")
TWIST = ("x", "y", "z", "wx", "wy", "wz")
COORDINATES = ("x", "y", "z", "roll", "pitch", "yaw")
ANGLES = ("roll", "pitch", "yaw")
RATES = ("velocity", "acceleration")
WRENCH = ("fx", "fy", "fz", "mx", "my", "mz")

#: Units of quantities of a joint that slides, and of one that turns.
UNITS = {
    "position": ("m", "rad"), "velocity": ("m/s", "rad/s"), "acceleration": ("m/s^2", "rad/s^2"),
    "effort": ("N", "N m"), "speed": ("m/s", "rad/s"), "power": ("W", "W"),
}  # fmt: skip

#: Components of position and of velocity of the joints with several freedoms.
JOINT_COMPONENTS = {
    "spherical": (("qx", "qy", "qz", "qw"), ("wx", "wy", "wz")),
    "planar": (("x", "y", "yaw"), ("x", "y", "wz")),
    "floating": (POSE, TWIST),
}


def joint_columns(joint: str, kind: str, quantity: str) -> list[str]:
    """Return the columns of a joint's position, velocity or acceleration, by components if it has several."""
    places, rates = JOINT_COMPONENTS.get(kind, (("",), ("",)))
    parts = places if quantity == "position" else rates
    return [f"{joint}/{quantity}/{part}".rstrip("/") for part in parts]


def unit_of(kind: str, quantity: str = "position") -> str:
    """Return the unit of a quantity of a joint with one freedom, by its kind."""
    return UNITS[quantity][kind != "prismatic"]


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


def joint_signal(
    joint: Joint,
    given: dict[str, dict[str, int]],
    file: str | None,
    wanted: tuple[str, ...] = RATES,
    *,
    endless: bool = False,
) -> Signal:
    """Build the signal of a joint.

    Args:
        endless: Whether it is a gear that turns without limits.
        given: Columns by quantity and component.
        file: Path of the table, for messages.
        wanted: The needed ones of "velocity" and "acceleration".

    Raises:
        TrajectoryError: A component is missing or unknown, or rates that cannot be fitted are missing.
    """
    components, rates = JOINT_COMPONENTS.get(joint.kind, (("",), ("",)))
    what = f"joint '{joint.name}' ({joint.kind})"
    signal = Signal(
        name=joint.name,
        components=components,
        position=_picked(given.get("position", {}), components, f"{joint.name}/position", what, file),
        velocity=_rates(given, "velocity", rates, joint.name, what, file),
        acceleration=_rates(given, "acceleration", rates, joint.name, what, file),
        wraps=(0,) if joint.kind == "continuous" or endless else (),
        wanted=wanted,
    )
    if joint.kind in JOINT_COMPONENTS and signal.missing:
        message = f"is missing: rates of a {joint.kind} joint are not fitted"
        raise TrajectoryError(message, file=file, column=f"{joint.name}/{signal.missing[0]}/{rates[0]}")
    return signal


def pose_signal(
    key: str, given: dict[str, dict[str, int]], file: str | None, wanted: tuple[str, ...] = RATES
) -> Signal:
    """Build the signal of a pose: the whole pose with a quaternion, or some of its coordinates.

    Args:
        key: The link, as in the header.
        given: Columns by quantity and component.
        file: Path of the table, for messages.
        wanted: The needed ones of "velocity" and "acceleration".

    Raises:
        TrajectoryError: A component is missing or unknown.
    """
    pose = given.get("pose", {})
    components: tuple[str, ...] = POSE
    rates: tuple[str, ...] = TWIST
    if pose and not set(pose) & set(POSE[3:]):  # no quaternion: any of the six coordinates
        components = rates = tuple(name for name in COORDINATES if name in pose) or COORDINATES
    what = f"the pose of '{key}' by its {'quaternion' if components == POSE else 'coordinates'}"
    return Signal(
        name=key,
        components=components,
        position=_picked(pose, components, f"{key}/pose", what, file),
        velocity=_rates(given, "velocity", rates, key, what, file),
        acceleration=_rates(given, "acceleration", rates, key, what, file),
        wraps=tuple(index for index, name in enumerate(components) if name in ANGLES),
        wanted=wanted,
    )


def _rates(
    given: dict[str, dict[str, int]],
    quantity: str,
    names: tuple[str, ...],
    owner: str,
    what: str,
    file: str | None,
) -> tuple[int, ...] | None:
    if quantity not in given:
        return None
    return _picked(given[quantity], names, f"{owner}/{quantity}", what, file)


def wrench_columns(key: str, given: dict[str, int], file: str | None) -> tuple[int, ...]:
    """Return the columns of all six components of a wrench.

    Raises:
        TrajectoryError: A component is missing or unknown.
    """
    return _picked(given, WRENCH, f"{key}/wrench", f"a wrench on '{key}'", file)


def _picked(
    given: dict[str, int], names: tuple[str, ...], prefix: str, what: str, file: str | None
) -> tuple[int, ...]:
    """Return the columns of exactly these components; the error names an unknown or missing one."""
    expected = ", ".join(f"{prefix}/{name}" if name else prefix for name in names)
    for name in given:
        if name not in names:
            column = f"{prefix}/{name}" if name else prefix
            raise TrajectoryError(f"does not belong here: {what} takes {expected}", file=file, column=column)
    for name in names:
        if name not in given:
            column = f"{prefix}/{name}" if name else prefix
            raise TrajectoryError(f"is missing: {what} takes {expected}", file=file, column=column)
    return tuple(given[name] for name in names)
