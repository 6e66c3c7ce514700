"""Derivatives of measures over the motion and the efforts: those of a peak are at its own sample."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np

from ...description.records import Joint
from ...errors import ModelError
from ...gradients.gradient import MeasureBars
from ...spatial import Array
from ...streams.postures import TreeSamples
from ...structure.robot import HybridRobot
from ...tables.over_time import TIE
from ...tables.signals import TWIST
from ..sizing import motor_rows
from .measures import OF_MOTORS, STATISTICS
from .motion_columns import OF_LINK, column_of


class MotorColumns(NamedTuple):
    """Motion and efforts of the motors, shape (T, motors) each; positions of continuous joints are NaN."""

    time: Array | None
    position: Array
    speed: Array
    effort: Array


class Slopes(NamedTuple):
    """Derivatives of a measure.

    Attributes:
        bars: Over the motion and the efforts.
        limits: Over the limits of the motors, in the order of `limits_of`, shape (motors, 4).
    """

    bars: MeasureBars
    limits: Array


def limits_of(joints: Iterable[Joint]) -> Array:
    """Return lower, upper, speed and effort limit of motors, shape (motors, 4); those without are zero."""
    rows = [(one.lower, one.upper, one.speed_limit, one.effort_limit) for one in joints]
    limits = np.array(rows, dtype=float).reshape(-1, 4)
    return np.where(np.isfinite(limits), limits, 0.0)


def slopes_of(robot: HybridRobot, word: str, whole: TreeSamples, tau: Array) -> Slopes:
    """Return the derivatives of a measure of a trajectory.

    Args:
        robot: The robot of the design.
        word: The measure.
        whole: The postures.
        tau: Efforts, shape (T, motors).

    Raises:
        ModelError: It is a function in Python or of a package.
        TrajectoryError: There is no such column.
    """
    none = np.zeros((len(tau), robot.nv))
    out = MeasureBars(none, none.copy(), none.copy(), np.zeros(tau.shape), {})
    slopes = Slopes(out, np.zeros((len(robot.motors), 4)))
    if word in OF_MOTORS:
        motion = MotorColumns(whole.motion.time, *motor_rows(robot, whole.q, whole.v), tau)
        _of_motors(robot, word, motion, slopes)
        return slopes
    statistic, _, column = word.partition(" ")
    if statistic not in STATISTICS:
        raise ModelError(
            f"measure '{word}' has no gradient: there are gradients of measures of motors and of columns; "
            "leave it out of the study, and compute it from theirs",
            element=word,
        )
    x = column_of(robot, whole, tau, column)
    _of_column(robot, column, _slope(statistic, x, whole.motion.time), whole, tau, out)
    return slopes


def _means(time: Array | None, rows: int) -> Array:
    """Return the weight of each row in a mean, shape (rows,), as `tables.over_time` has it."""
    if time is None or time[-1] <= time[0]:
        return np.full(rows, 1.0 / rows)
    step = np.diff(time) / 2.0
    out: Array = (np.r_[step, 0.0] + np.r_[0.0, step]) / (time[-1] - time[0])
    return out


def _at(row: int, slope: float, rows: int) -> Array:
    """Return the derivative of one row's value."""
    out = np.zeros(rows)
    out[row] = slope
    return out


def _peak(x: Array) -> int:
    """Return the row of the largest magnitude; of equal ones the first, as `tables.over_time.Peaks`."""
    sizes = np.abs(x)
    return int(np.argmax(sizes >= sizes.max() * (1 - TIE)))


def _slope(statistic: str, x: Array, time: Array | None) -> Array:
    """Return the derivative of a statistic over the values of a column, shape (T,)."""
    rows = len(x)
    if statistic == "mean":
        return _means(time, rows)
    if statistic == "rms":
        means = _means(time, rows)
        size = math.sqrt(float(means @ x**2))
        return means * x / size if size else np.zeros(rows)
    row = {"peak": _peak(x), "max": int(x.argmax()), "min": int(x.argmin()), "final": rows - 1}[statistic]
    return _at(row, float(np.sign(x[row])) if statistic == "peak" else 1.0, rows)


def _of_column(
    robot: HybridRobot, column: str, slope: Array, whole: TreeSamples, tau: Array, out: MeasureBars
) -> None:
    """Add the derivatives of a column of a link, a joint or a motor."""
    if match := OF_LINK.fullmatch(column):
        at = {"pose": 0, "velocity": 3, "acceleration": 9}[match["quantity"]]
        weights = np.zeros((len(slope), 15))
        weights[:, at + TWIST.index(match["component"])] = slope
        out.links[match["link"]] = weights
        return
    owner, _, quantity = column.rpartition("/")
    at = robot.v_slices[robot.joint_index[owner]].start
    levels = {"position": out.q, "velocity": out.v, "acceleration": out.a}
    if quantity in levels:
        levels[quantity][:, at] += slope
        return
    motor = robot.motors.index(owner)
    power = quantity == "power"
    out.tau[:, motor] += slope * whole.v[:, at] if power else slope
    if power:
        out.v[:, at] += slope * tau[:, motor]


#: What limits bound, in the order of `limits_of`.
LIMITS = ("lower", "upper", "speed", "effort")
#: Statistic of a motor's effort, speed or power that a measure takes the largest, smallest or sum of.
_STATED: dict[str, tuple[str, str]] = {
    "peak_effort": ("peak", "effort"), "rms_effort": ("rms", "effort"), "effort_margin": ("peak", "effort"),
    "peak_speed": ("peak", "speed"), "rms_speed": ("rms", "speed"), "speed_margin": ("peak", "speed"),
    "mean_power": ("mean", "power"), "peak_power": ("max", "power"), "braking_power": ("min", "power"),
}  # fmt: skip


def _of_motors(robot: HybridRobot, word: str, motion: MotorColumns, slopes: Slopes) -> None:
    """Add the derivatives of a measure of the motors, by the motor that has the number where one has."""
    records = [robot.records[name] for name in robot.motors]
    time, rows, motors = motion.time, len(motion.effort), range(len(records))
    power, out = motion.effort * motion.speed, slopes.bars
    if word == "stroke_margin":
        _of_stroke(robot, motion, slopes)
        return
    if word in ("energy", "mean_power"):
        duration = 0.0 if time is None else float(time[-1] - time[0])
        slope = _means(time, rows) * (duration if word == "energy" else 1.0)
        counts = power > 0 if word == "energy" else np.ones(power.shape, dtype=bool)
        for i in motors:
            _add(robot, i, "power", slope * counts[:, i], motion, out)
        return
    statistic, quantity = _STATED[word]
    of = {"effort": motion.effort, "speed": motion.speed, "power": power}[quantity]
    of_margin = word.endswith("_margin")
    limits = [getattr(one, f"{quantity}_limit") if of_margin else 1.0 for one in records]
    values = [abs(_value(statistic, of[:, i], time)) / limits[i] for i in motors]
    i = int(np.argmax(values))
    if statistic in ("min", "max") and not values[i]:  # no motor ever brakes, or drives
        return
    sign = -1.0 if of_margin or statistic == "min" else 1.0
    if math.isfinite(limits[i]):
        _add(robot, i, quantity, sign / limits[i] * _slope(statistic, of[:, i], time), motion, out)
        if of_margin:
            slopes.limits[i, LIMITS.index(quantity)] += values[i] / limits[i]


def _value(statistic: str, x: Array, time: Array | None) -> float:
    """Return a statistic of a motor; power that it never gives, or never takes, is none."""
    value = STATISTICS[statistic](x, time)
    return max(value, 0.0) if statistic == "max" else min(value, 0.0) if statistic == "min" else value


def _add(
    robot: HybridRobot, motor: int, quantity: str, slope: Array, motion: MotorColumns, out: MeasureBars
) -> None:
    """Add the derivative over a motor's effort, speed or power, shape (T,)."""
    at = int(robot.motor_v[motor])
    if quantity in ("effort", "power"):
        out.tau[:, motor] += slope * (motion.speed[:, motor] if quantity == "power" else 1.0)
    if quantity in ("speed", "power"):
        out.v[:, at] += slope * (motion.effort[:, motor] if quantity == "power" else 1.0)


def _of_stroke(robot: HybridRobot, motion: MotorColumns, slopes: Slopes) -> None:
    """Add the derivative of the smallest distance to a position limit, as a part of the stroke.

    (x - lower) / (upper - lower), or (upper - x) / (upper - lower)
    """
    found: list[tuple[float, int, int, float]] = []
    ends: tuple[tuple[Callable[[Array], np.intp], float], ...] = ((np.argmin, 1.0), (np.argmax, -1.0))
    for i, name in enumerate(robot.motors):
        joint, x = robot.records[name], motion.position[:, i]
        stroke = joint.upper - joint.lower
        if not (np.isfinite(x).all() and 0 < stroke < math.inf):
            continue
        for pick, sign in ends:
            row = int(pick(x))
            gap = x[row] - joint.lower if sign > 0 else joint.upper - x[row]
            found.append((float(gap) / stroke, i, row, sign / stroke))
    if found:
        margin, i, row, slope = min(found)
        slopes.bars.q[row, int(robot.motor_v[i])] += slope
        near, far = (0, 1) if slope > 0 else (1, 0)
        slopes.limits[i, near] += slope * (margin - 1.0)
        slopes.limits[i, far] -= slope * margin
