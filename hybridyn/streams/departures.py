"""Find the samples at which a motion exceeds the joint limits of position, speed and effort.

Exporters write an empty range (lower = upper) or a limit of zero where they do not know the limit. Both count
as no limit here.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from ..description.records import Joint
from ..spatial import Array
from ..structure.robot import HybridRobot
from ..tables.signals import unit_of
from .other_units import other_unit

#: A speed or an effort may exceed its limit by this part of the limit, so that a motion may touch the limit.
TOUCHING = 1e-9
#: A position may exceed its limit by this part of the joint's range, because files are rounded.
ROUNDED = 1e-6
#: Largest number of departures that are listed one by one.
MOST_LISTED = 8


@dataclass(frozen=True, eq=False)
class Departure:
    """Samples at which a joint exceeds one of its limits.

    Attributes:
        quantity: "position", "speed" or "effort".
        unit: Unit of the quantity.
        limit: The limit that is exceeded most.
        worst: The value that exceeds its limit most.
        by: Difference between `worst` and `limit`, positive.
        first: Number of the first sample outside the limits, from 0.
        count: Number of samples outside the limits.
        question: Whether a position has another unit: "degrees?", "millimetres?" or "".
    """

    joint: str
    quantity: str
    unit: str
    limit: float
    worst: float
    by: float
    first: int
    count: int
    question: str = ""


def departures(robot: HybridRobot, q: Array, v: Array, tau: Array | None = None) -> tuple[Departure, ...]:
    """Return the joints that exceed their limits in a motion, one entry per joint and quantity.

    Args:
        q: Positions, shape (T, nq).
        v: Rates, shape (T, nv).
        tau: Efforts of the motors, shape (T, motors), or None.
    """
    joints = robot.records
    placed = [(joints[name], i) for i, name in enumerate(robot.joints) if name in joints]
    single = [(joint, i) for joint, i in placed if joint.kind in ("revolute", "continuous", "prismatic")]
    ranged = [(joint, robot.q_slices[i].start) for joint, i in single if position_limits(joint)]
    fast = [(joint, robot.v_slices[i].start) for joint, i in single if joint.speed_limit < np.inf]
    out = [*_outside("position", q, ranged), *_outside("speed", v, fast)]
    if tau is not None:
        strong = [
            (joints[name], i) for i, name in enumerate(robot.motors) if joints[name].effort_limit < np.inf
        ]
        out += _outside("effort", tau, strong)
    return tuple(out)


def position_limits(joint: Joint) -> tuple[float, float] | None:
    """Return the lowest and the highest position that count as inside the limits, or None without limits."""
    lower, upper = joint.lower, joint.upper
    if joint.kind == "continuous" or not lower < upper or (np.isinf(lower) and np.isinf(upper)):
        return None
    ends = [abs(end) for end in (lower, upper) if np.isfinite(end)]
    slack = ROUNDED * (upper - lower if len(ends) == 2 else max(*ends, 1.0))
    return lower - slack, upper + slack


def _outside(quantity: str, values: Array, limited: list[tuple[Joint, int]]) -> Iterator[Departure]:
    """Yield one departure for each column that exceeds its limits."""
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
            unit_of(joints[i].kind, quantity),
            high if value > high else low,
            value,
            float(beyond[worst]),
            int(outside[0]),
            len(outside),
            other_unit(joints[i], value, np.inf) if quantity == "position" else "",
        )


def _stated(quantity: str, joint: Joint) -> tuple[float, float]:
    """Return the limits of a quantity as the file states them."""
    if quantity == "position":
        return joint.lower, joint.upper
    size = joint.velocity if quantity == "speed" else joint.effort
    return -size, size


def _range(quantity: str, joint: Joint) -> tuple[float, float]:
    """Return the lowest and the highest value that count as inside the limits."""
    if quantity == "position":
        return position_limits(joint) or (-np.inf, np.inf)
    low, high = _stated(quantity, joint)
    return low * (1 + TOUCHING), high * (1 + TOUCHING)


class Departures:
    """Departures of a whole motion, collected from its blocks in order."""

    def __init__(self) -> None:
        self._found: dict[tuple[str, str], Departure] = {}
        self._at: dict[tuple[str, str], str] = {}

    def add(self, found: Iterable[Departure], first_row: int, time: Array | None) -> None:
        """Add the departures of the next block.

        Args:
            found: Departures of the block.
            first_row: Number of the block's first row in the table.
            time: Times of the block's rows, shape (T,), [s], or None.
        """
        for one in found:
            key, at = (one.joint, one.quantity), "" if time is None else f" ({time[one.first]:.6g} s)"
            self._at.setdefault(key, f"row {first_row + one.first}{at}")
            before = self._found.get(key, one)
            worse = one if one.by > before.by else before
            count = one.count if before is one else before.count + one.count
            self._found[key] = replace(worse, first=before.first, count=count)

    def __iter__(self) -> Iterator[Departure]:
        """Return the departures, in the order in which they were found."""
        return iter(self._found.values())

    def line(self, one: Departure) -> str:
        """Describe where a joint exceeds its limit, and by how much."""
        unit, many = one.unit, "" if one.count == 1 else "s"
        return (
            f"joint '{one.joint}' leaves its limits: {one.quantity} of {one.worst:.6g} {unit}, limit "
            f"{one.limit:g} {unit}, by {one.by:.3g} {unit}; first at {self._at[one.joint, one.quantity]}, "
            f"{one.count:,} sample{many}" + (f": {one.question}" if one.question else "")
        )

    def lines(self) -> list[str]:
        """Return one line per departure; after `MOST_LISTED` lines, one line with the number of the rest."""
        lines = [self.line(one) for one in self]
        if len(lines) <= MOST_LISTED:
            return lines
        return [*lines[:MOST_LISTED], f"... and {len(lines) - MOST_LISTED} more limits that joints leave"]
