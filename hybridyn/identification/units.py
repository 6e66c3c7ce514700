"""Units and signs of a log, found by comparison with the numbers of the robot's file."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..errors import HybridynError, TrajectoryError
from ..spatial import Array
from ..streams.departures import other_unit
from ..structure.robot import HybridRobot
from .logs import Log
from .regressor import done_together
from .rows import LogRows, LogSource
from .signals import Triple, means, processed

#: Samples on which units are tested, and correlation of measured and predicted efforts that tells a unit.
TESTED, TELLING = 60, 0.95
#: Units of efforts by their decades, and the largest deviation from these.
UNITS, NEAR = {3: "N mm or mN", -3: "kN"}, 0.15
#: Units of times by how many of them a second has.
TIMES = {1e3: ("a thousand", "milliseconds"), 1e6: ("a million", "microseconds"), 1e9: ("1e9", "nanoseconds")}


def check_log(source: LogSource, log: Log) -> None:
    """Check the units of positions and times, before anything that depends on them.

    Raises:
        TrajectoryError: A position is far beyond the motor's limits, or the efforts are those of the robot's
            file with times in another unit.
    """
    _ask_units(source.robot, log)
    _check_times(source, log)


def _ask_units(robot: HybridRobot, log: Log) -> None:
    """Check that positions are in metres and radians, as far as limits tell.

    Raises:
        TrajectoryError: A position is far beyond the motor's limits.
    """
    for name, column in zip(robot.motors, log.position.T, strict=True):
        joint, worst = robot.records[name], float(column[np.argmax(np.abs(column))])
        if asked := other_unit(joint, worst, robot.bodies.size):
            raise TrajectoryError(
                f"goes to {worst:g}, limits {joint.lower:g} and {joint.upper:g}: {asked} "
                "Positions are in m and rad",
                file=log.file, column=f"{name}/position",
            )  # fmt: skip


def check_scales(source: LogSource, data: LogRows) -> None:
    """Check each motor's efforts for factors of a thousand and wrong signs, by the file's numbers.

    A factor counts only where measured and predicted efforts are alike otherwise.

    Raises:
        TrajectoryError: A column is in another unit.
    """
    file, motors = data.log.file, source.robot.motors
    for name, raw, *pair in zip(motors, data.log.effort.T, data.measured.T, data.of_file.T, strict=True):
        if not np.ptp(raw):
            raise TrajectoryError(
                f"is {raw[0]:g} in every row: it was not measured", file=file, column=f"{name}/effort"
            )
        like, factor = _alike(*pair)
        decades = float(np.log10(abs(factor)))
        unit = None if data.log.currents else UNITS.get(round(decades))
        if like > TELLING and unit and abs(decades - round(decades)) < NEAR:
            raise TrajectoryError(
                f"efforts are {abs(factor):.4g} times those that the robot's file predicts: {unit}? "
                "Efforts are in N and N m", file=file, column=f"{name}/effort",
            )  # fmt: skip
        if like > TELLING and factor < 0:
            raise TrajectoryError(
                "efforts have the opposite sign of what the robot's file predicts: positive is along the "
                "joint's axis", file=file, column=f"{name}/effort",
            )  # fmt: skip


def _check_times(source: LogSource, log: Log) -> None:
    """Check whether the same path in another unit of time explains the efforts better.

    The path is filtered and differentiated as without a band and a period, which are in seconds themselves.

    Raises:
        TrajectoryError: It does.
    """
    source = replace(source, band=None, period=None, every=None)
    try:
        done = processed(log)
    except TrajectoryError:  # too few samples to tell
        return
    every = source.every_of(done)
    count = len(done.time) // every
    pick = np.linspace(0, count - 1, min(TESTED, count)).astype(int)
    x, x_dot, x_ddot = (level[pick * every + every // 2] for level in done.motion)
    measured = means(done.effort, every)[pick]
    try:
        states = source.closed((x, x_dot, x_ddot), None)
        together = done_together(source.robot, states[0])
    except HybridynError:  # in any unit of time
        return
    if together is not None:
        measured = np.einsum("tij,tj->ti", together, measured)
    like = _likes(source, states, measured, (1.0, *TIMES))
    best = max(like, key=lambda factor: like[factor])
    if best > 1 and like[best] > max(TELLING, like[1.0] + (1 - like[1.0]) / 2):
        raise TrajectoryError(
            f"with times {TIMES[best][0]} times shorter the efforts are those of the robot's file "
            f"(correlation {like[best]:.3f} instead of {like[1.0]:.3f}): {TIMES[best][1]}? Times are in s",
            file=log.file, column="time",
        )  # fmt: skip


def _likes(
    source: LogSource, states: Triple, measured: Array, factors: Sequence[float]
) -> dict[float, float]:
    """Return how far measured efforts are those of the same path so many times faster; 0 if unknown."""
    f = np.repeat(factors, len(measured))[:, None]
    q, v, a = (np.tile(level, (len(factors), 1)) for level in states)
    try:
        _, _, of_file = source.of_states(q, f * v, f**2 * a)
    except HybridynError:
        if len(factors) == 1:
            return {factors[0]: 0.0}
        return {factor: _likes(source, states, measured, [factor])[factor] for factor in factors}
    each = np.split(of_file, len(factors))
    return {factor: _alike(measured, one)[0] for factor, one in zip(factors, each, strict=True)}


def _alike(measured: Array, predicted: Array) -> tuple[float, float]:
    """Return the correlation of efforts (their cosine), and the factor between them."""
    sizes = float(np.linalg.norm(measured)), float(np.linalg.norm(predicted))
    if not min(sizes):
        return 0.0, 1.0
    dot = float(np.vdot(measured, predicted))
    return abs(dot) / sizes[0] / sizes[1], dot / sizes[1] ** 2
