"""Where a motion leaves the limits of joints: position, speed and effort, first sample and worst.

A range that is empty (lower = upper) and a limit of zero are what exporters write for "not known": they are
no limits here.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from ..description.records import Joint
from ..spatial import Array
from .robot import HybridRobot

#: A speed or an effort is over its limit beyond this part of it: a motion that just touches it is not.
TOUCHING = 1e-9
#: A position is outside beyond this part of the joint's range: files are rounded.
ROUNDED = 1e-6
UNITS = {"position": ("m", "rad"), "speed": ("m/s", "rad/s"), "effort": ("N", "N m")}
#: Most departures that are told one by one.
TOLD = 8


@dataclass(frozen=True)
class Departure:
    """A joint that leaves one of its limits.

    Attributes:
        joint: Name of the joint.
        quantity: "position", "speed" or "effort".
        unit: Its unit.
        limit: The limit that is passed farthest.
        worst: The value farthest outside.
        by: How far that is outside, positive.
        first: Number of the first sample outside, from 0.
        count: Number of samples outside.
    """

    joint: str
    quantity: str
    unit: str
    limit: float
    worst: float
    by: float
    first: int
    count: int

    def then(self, later: Departure) -> Departure:
        """Return both as one; `later` comes after this one."""
        worse = later if later.by > self.by else self
        return replace(worse, first=self.first, count=self.count + later.count)


def departures(robot: HybridRobot, q: Array, v: Array, tau: Array | None = None) -> tuple[Departure, ...]:
    """Return the joints that leave their limits in a motion, each once for each quantity.

    Args:
        robot: The robot.
        q: Positions, shape (T, nq).
        v: Rates, shape (T, nv).
        tau: Efforts of the motors, shape (T, motors), or None.
    """
    joints = {joint.name: joint for joint in robot.description.joints}
    placed = [(joints[name], i) for i, name in enumerate(robot.joints) if name in joints]
    single = [(joint, i) for joint, i in placed if joint.kind in ("revolute", "continuous", "prismatic")]
    ranged = [(joint, robot.q_slices[i].start) for joint, i in single if position_limits(joint)]
    fast = [(joint, robot.v_slices[i].start) for joint, i in single if 0 < joint.velocity < np.inf]
    out = [*_outside("position", q, ranged), *_outside("speed", v, fast)]
    if tau is not None:
        strong = [
            (joints[name], i) for i, name in enumerate(robot.motors) if 0 < joints[name].effort < np.inf
        ]
        out += _outside("effort", tau, strong)
    return tuple(out)


def position_limits(joint: Joint) -> tuple[float, float] | None:
    """Return the least and the greatest position that count as inside, or None where nothing limits a joint.

    Args:
        joint: The joint.
    """
    lower, upper = joint.lower, joint.upper
    if joint.kind == "continuous" or not lower < upper or (np.isinf(lower) and np.isinf(upper)):
        return None
    ends = [abs(end) for end in (lower, upper) if np.isfinite(end)]
    slack = ROUNDED * (upper - lower if len(ends) == 2 else max(*ends, 1.0))
    return lower - slack, upper + slack


def _outside(quantity: str, values: Array, limited: list[tuple[Joint, int]]) -> Iterator[Departure]:
    """Look for columns that leave their limits."""
    if not limited or not len(values):
        return
    joints, columns = zip(*limited, strict=True)
    rows = values[:, list(columns)]
    lower, upper = np.array([_range(quantity, joint) for joint in joints]).T
    for i in np.flatnonzero((rows.max(axis=0) > upper) | (rows.min(axis=0) < lower)):
        low, high = _stated(quantity, joints[i])
        column = rows[:, i]
        outside = np.flatnonzero((column > upper[i]) | (column < lower[i]))
        beyond = np.maximum(column[outside] - high, low - column[outside])
        worst = int(beyond.argmax())
        value = float(column[outside[worst]])
        yield Departure(
            joints[i].name,
            quantity,
            UNITS[quantity][joints[i].kind != "prismatic"],
            high if value > high else low,
            value,
            float(beyond[worst]),
            int(outside[0]),
            len(outside),
        )


def _stated(quantity: str, joint: Joint) -> tuple[float, float]:
    """Return the limits of a quantity as the file states them."""
    if quantity == "position":
        return joint.lower, joint.upper
    size = joint.velocity if quantity == "speed" else joint.effort
    return -size, size


def _range(quantity: str, joint: Joint) -> tuple[float, float]:
    """Return the least and the greatest value that count as inside."""
    if quantity == "position":
        return position_limits(joint) or (-np.inf, np.inf)
    low, high = _stated(quantity, joint)
    return low * (1 + TOUCHING), high * (1 + TOUCHING)


class Departures:
    """Departures of a whole motion, gathered block by block in order."""

    def __init__(self) -> None:
        """Start with none."""
        self._found: dict[tuple[str, str], Departure] = {}
        self._at: dict[tuple[str, str], str] = {}

    def add(self, found: Iterable[Departure], first_row: int, time: Array | None) -> None:
        """Take in a block.

        Args:
            found: Its departures.
            first_row: Number of its first row in the table.
            time: Times of its rows, shape (T,), [s], or None.
        """
        for one in found:
            key = one.joint, one.quantity
            if key in self._found:
                self._found[key] = self._found[key].then(one)
                continue
            self._found[key] = one
            at = "" if time is None else f" ({time[one.first]:.6g} s)"
            self._at[key] = f"row {first_row + one.first}{at}"

    def __iter__(self) -> Iterator[Departure]:
        """Return the departures, in the order in which they were found."""
        return iter(self._found.values())

    def line(self, one: Departure) -> str:
        """Say where a joint leaves its limit, and by how much.

        Args:
            one: One of the departures.
        """
        unit, many = one.unit, "" if one.count == 1 else "s"
        return (
            f"joint '{one.joint}' leaves its limits: {one.quantity} of {one.worst:.6g} {unit}, limit "
            f"{one.limit:g} {unit}, by {one.by:.3g} {unit}; first at {self._at[one.joint, one.quantity]}, "
            f"{one.count:,} sample{many}"
        )

    def lines(self) -> list[str]:
        """Say which joints leave their limits, the first of many one by one."""
        told = [self.line(one) for one in self]
        if len(told) <= TOLD:
            return told
        return [*told[:TOLD], f"... and {len(told) - TOLD} more limits that joints leave"]
