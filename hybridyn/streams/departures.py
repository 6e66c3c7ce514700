"""Find the samples at which a motion exceeds the joint limits of position, speed and effort.

A position far beyond its limits is asked whether it is in degrees or millimetres.

Exporters write an empty range (lower = upper) or a limit of zero where they do not know the limit. Both count
as no limit here.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..description.records import Joint
from ..spatial import Array
from ..structure.robot import HybridRobot
from ..tables.signals import unit_of
from ..tables.trajectory import TableMotion

if TYPE_CHECKING:
    from ..effects.dc_motors import OnDcMotors

#: A speed or an effort may exceed its limit by this part of the limit, so that a motion may touch the limit.
TOUCHING = 1e-9
#: A position may exceed its limit by this part of the joint's range, because files are rounded.
ROUNDED = 1e-6
#: Largest number of departures that are listed one by one.
MOST_LISTED = 8
#: Angle that a joint without limits hardly has [rad].
TURNS = 4 * math.pi


@dataclass(frozen=True, eq=False)
class Departure:
    """Samples at which a joint exceeds one of its limits.

    Attributes:
        quantity: "position", "speed", "effort", "current" or "voltage".
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
    single = [i for i, kind in enumerate(robot.kinds) if kind.single]
    moving = [joints[robot.joints[i]] for i in single]
    checked = [
        ("position", q[:, [robot.q_slices[i].start for i in single]], moving),
        ("speed", v[:, [robot.v_slices[i].start for i in single]], moving),
    ]
    if tau is not None:
        checked.append(("effort", tau, [joints[name] for name in robot.motors]))
    return tuple(one for given in checked if given[2] and len(q) for one in _outside(*given))


def beyond_supply(robot: HybridRobot, law: OnDcMotors, speed: Array, tau: Array) -> Iterator[Departure]:
    """Yield a departure for each DC motor that needs more current or voltage than it has.

    Args:
        law: The motors.
        speed, tau: Rates and efforts of all motors, shape (T, motors).
    """
    needs = ("current", "A", law.currents(tau), law.current), (
        "voltage", "V", law.voltages(tau, speed), law.voltage)  # fmt: skip
    for quantity, unit, rows, limit in needs:
        for i in np.flatnonzero((np.abs(rows) > limit * (1 + TOUCHING)).any(axis=0)):
            bounds = -limit[i], limit[i], TOUCHING * limit[i]
            yield _departure(robot.motors[law.motors[i]], quantity, unit, rows[:, i], bounds)


def position_limits(joint: Joint) -> tuple[float, float] | None:
    """Return the lowest and the highest position that count as inside the limits, or None without limits."""
    lower, upper, slack = _limits("position", joint)
    return None if lower == -np.inf and upper == np.inf else (lower - slack, upper + slack)


def _limits(quantity: str, joint: Joint) -> tuple[float, float, float]:
    """Return the limits of a quantity as the file states them, and by how much they may be exceeded."""
    if quantity != "position":
        size = joint.speed_limit if quantity == "speed" else joint.effort_limit
        return -size, size, TOUCHING * size
    lower, upper = joint.lower, joint.upper
    if joint.kind.endless or not lower < upper:
        return -np.inf, np.inf, 0.0
    ends = [abs(end) for end in (lower, upper) if np.isfinite(end)]
    return lower, upper, ROUNDED * (upper - lower if len(ends) == 2 else max([*ends, 1.0]))


def _outside(quantity: str, rows: Array, joints: Sequence[Joint]) -> Iterator[Departure]:
    """Yield one departure for each column that exceeds the limits of its joint."""
    lower, upper, slack = np.array([_limits(quantity, joint) for joint in joints]).T
    low, high = lower - slack, upper + slack
    for i in np.flatnonzero((rows.max(axis=0) > high) | (rows.min(axis=0) < low)):
        joint, bounds = joints[int(i)], (lower[i], upper[i], slack[i])
        one = _departure(joint.name, quantity, unit_of(joint.kind, quantity), rows[:, i], bounds)
        asked = other_unit(joint, one.worst, np.inf) if quantity == "position" else ""
        yield replace(one, question=asked)


def _departure(
    joint: str, quantity: str, unit: str, column: Array, bounds: tuple[float, float, float]
) -> Departure:
    """Return where a column leaves its bounds, which it does: lower, upper, and what may exceed them."""
    lower, upper, slack = bounds
    outside = np.flatnonzero((column > upper + slack) | (column < lower - slack))
    beyond = np.maximum(column[outside] - upper, lower - column[outside])
    value = float(column[outside[beyond.argmax()]])
    limit, worst = float(upper if value > upper else lower), float(beyond.max())
    return Departure(joint, quantity, unit, limit, value, worst, int(outside[0]), len(outside))


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


def other_unit(joint: Joint, position: float, size: float) -> str:
    """Return the question whether a position has another unit: "degrees?", "millimetres?" or "".

    It has if it is as many times beyond the limits as the square root of the ratio of the two units.

    Args:
        joint: A joint with one freedom.
        position: Its position [m or rad].
        size: Size of the robot, for slides without limits [m].
    """
    slides = joint.kind.slides
    bound, ratio = (size, 1e3) if slides else (TURNS, 180 / math.pi)
    if joint.lower < joint.upper and math.isfinite(joint.upper - joint.lower):
        bound = max(abs(joint.lower), abs(joint.upper))
    if abs(position) <= bound * math.sqrt(ratio):
        return ""
    return "millimetres?" if slides else "degrees?"


def question(robot: HybridRobot, motion: TableMotion) -> str:
    """Return the question about the unit of a motion that cannot be assembled, with a number, or ""."""
    size = robot.bodies.size
    for name, (position, *_) in motion.joints.items():
        joint, column = robot.records[name], np.ravel(position)
        worst = float(column[np.argmax(np.abs(column))])
        if asked := other_unit(joint, worst, size):
            limits = f"(limits {joint.lower:g} and {joint.upper:g})"
            return f". '{name}' goes to {worst:g} {unit_of(joint.kind)} {limits}: {asked}"
    for name, (pose, *_) in motion.platforms.items():
        part = [pose[word] for word in "xyz" if word in pose] if isinstance(pose, dict) else pose[..., :3]
        far = float(np.abs(part).max(initial=0.0))
        if far > size * math.sqrt(1e3):
            return f". '{name}' goes to {far:g} m, and the robot's size is {size:.3g} m: millimetres?"
    return ""
