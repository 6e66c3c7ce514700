"""From a log to the rows of tau = Y base + known: loops closed, rows thinned, units tested."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase

import numpy as np
from scipy import interpolate, linalg

from ..assembly.assemble import assemble
from ..compiled.model import CompiledRobot
from ..description.names import did_you_mean
from ..errors import HybridynError, ModelError, TrajectoryError
from ..spatial import Array, Mask
from ..streams.departures import other_unit
from ..structure.robot import HybridRobot
from .base_parameters import RANK, BaseParameters, led
from .regressor import effort_rows
from .signals import Log, Triple, means, processed

#: Entries of the whole regressor that are held at once.
ENTRIES = 4_000_000
#: Samples of a second after thinning, per hertz of the band: more tell hardly more.
PER_HERTZ = 4.0
#: Rows for each parameter that thinning leaves.
LEAST_EACH = 20
#: Samples that thinning leaves, so that a spectrum shows what is no noise.
LEAST = 500
#: Samples on which units are tested, and correlation of measured and predicted efforts that tells a unit.
TESTED, TELLING = 60, 0.95
#: Units of efforts by their decades, and the largest deviation from these.
UNITS, NEAR = {3: "N mm or mN", -3: "kN"}, 0.15


def linear_model(
    base: BaseParameters, known: Sequence[str] = (), only: Sequence[str] = ("*",)
) -> tuple[BaseParameters, Mask]:
    """Return the base parameters that are to be identified, and which standard parameters are known, (p,).

    Args:
        base: Base parameters of all.
        known: Names of parameters, or patterns, whose numbers are known.
        only: Names or patterns of those that are to be identified; the others are known.

    Raises:
        ModelError: A pattern matches nothing, or nothing is left to be identified.
    """

    def matching(patterns: Sequence[str]) -> Mask:
        """Return which parameters match a pattern, shape (p,)."""
        out = np.zeros(len(base.standard.names), dtype=bool)
        for pattern in patterns:
            own = np.array([fnmatchcase(name, pattern) for name in base.standard.names])
            if not own.any():
                raise ModelError(f"'{pattern}' is no parameter{did_you_mean(pattern, base.standard.names)}")
            out |= own
        return out

    fixed = matching(known) | ~matching(only)
    K = np.where(fixed, 0.0, base.combination) * base.unit / base.unit[base.columns, None]
    rank = int((linalg.svdvals(K) > RANK).sum())
    if not rank:
        raise ModelError("nothing is left to be identified: no effort depends on the chosen parameters")
    if not fixed.any():
        return base, fixed
    return led(K, rank, base.standard, base.unit), fixed


@dataclass(frozen=True, eq=False)
class Rows:
    """Thinned rows of a log.

    Attributes:
        log: The processed log.
        time: Times, shape (T,), [s].
        Y: Regressor of the base parameters, shape (T, motors, rank).
        measured: Efforts or currents, shape (T, motors).
        known: Efforts by the known parameters, shape (T, motors).
        of_file: Efforts by the numbers of the robot's file, shape (T, motors).
    """

    log: Log
    time: Array
    Y: Array
    measured: Array
    known: Array
    of_file: Array


@dataclass(frozen=True, eq=False)
class Source:
    """How logs become rows.

    Attributes:
        robot: The robot.
        model: The base parameters of tau = Y base + known.
        known: Whether each standard parameter is known, shape (p,).
        compiled: Compiled models, or None; as in `identify`, like all that follow.
        band: Band of the positions [Hz], or None.
        period: Period of the motion [s], or None.
        every: Samples that are averaged, or None.
    """

    robot: HybridRobot
    model: BaseParameters
    known: Mask
    compiled: CompiledRobot | None
    band: float | None = None
    period: float | None = None
    every: int | None = None

    def rows(self, log: Log) -> Rows:
        """Filter, differentiate, close the loops, and compute the rows of a log."""
        _ask_units(self.robot, log)
        done = processed(log, band=self.band, period=self.period)
        every = self.every_of(done)
        Y, known, of_file = self.regress(done.motion, every)
        thinned = f"means of {every} samples: {1 / done.step / every:.4g} a second"
        done = replace(done, remarks=(*done.remarks, thinned))
        return Rows(done, means(done.time, every), Y, means(done.effort, every), known, of_file)

    def every_of(self, log: Log) -> int:
        """Return how many samples are averaged."""
        if self.every is not None:
            return min(self.every, len(log.time))
        if log.band is None:
            return 1
        enough = len(log.time) * len(self.robot.motors) / (LEAST_EACH * len(self.model.names))
        return max(1, int(min(1 / log.step / (PER_HERTZ * log.band), enough, len(log.time) / LEAST)))

    def regress(self, motion: Triple, every: int) -> tuple[Array, Array, Array]:
        """Compute Y, known efforts and those by the file's numbers, thinned, from the motors' motion."""
        parts: list[list[Array]] = []
        guess, m = None, self.model
        step = max(1, ENTRIES // (len(self.robot.motors) * len(m.standard.names)) // every) * every
        rows = len(motion[0]) // every * every
        for first in range(0, rows, step):
            x, x_dot, x_ddot = (level[first : min(first + step, rows)] for level in motion)
            q, v, a = self.closed((x, x_dot, x_ddot), guess)
            guess = q[-1]
            parts.append([means(values, every) for values in self.of_states(q, v, a)])
        Y, known, of_file = (np.concatenate(part) for part in zip(*parts, strict=True))
        return Y, known, of_file

    def of_states(self, q: Array, v: Array, a: Array) -> Triple:
        """Compute Y, known efforts and those by the file's numbers at closed states."""
        Y, values = effort_rows(self.robot, self.model.standard, q, v, a), self.model.standard.values
        return Y[:, :, self.model.columns], Y @ np.where(self.known, values, 0.0), Y @ values

    def closed(self, motors: Triple, guess: Array | None) -> Triple:
        """Close the loops for a measured motion, the nearest of redundant motors; return q, v, a."""
        if self.compiled is not None:
            return self.compiled.assemble(motors=motors, guess=guess, nearest=True)
        return assemble(self.robot, motors=motors, guess=guess, nearest=True)

    def instruments(self, reference: Log, data: Rows) -> Array:
        """Compute the regressor of the commanded motion at the times of the rows, shape (T, motors, rank).

        Raises:
            TrajectoryError: The reference does not span the log.
        """
        time = data.log.time
        if reference.time[0] > time[0] or reference.time[-1] < time[-1]:
            raise TrajectoryError(
                f"the reference spans {reference.time[0]:g} to {reference.time[-1]:g} s and the log "
                f"{time[0]:g} to {time[-1]:g} s: give the whole command, on the log's clock",
                file=reference.file,
            )
        spline = interpolate.make_interp_spline(reference.time, reference.position, k=5)
        motion = spline(time), spline(time, nu=1), spline(time, nu=2)
        return self.regress(motion, self.every_of(data.log))[0]


def check_robot(robot: HybridRobot) -> None:
    """Check that motors alone say how a robot moves.

    Raises:
        ModelError: Its base moves, it has no motors, or one has several freedoms.
    """
    if robot.base != "fixed":
        raise ModelError(
            f"the base is {robot.base}: how it moved is not in a log of the motors; identify the robot on a "
            "fixed base (base='fixed')"
        )
    if not robot.motors:
        raise ModelError("the robot has no motors: name them (motors=[...])")
    for name in robot.motors:
        if robot.records[name].kind not in ("revolute", "continuous", "prismatic"):
            raise ModelError(f"motor '{name}' has several freedoms: no log has columns for it", element=name)


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


def check_scales(source: Source, data: Rows) -> None:
    """Check each motor's efforts, and time, for factors of a thousand and wrong signs, by the file's numbers.

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
    like = _alike(data.measured, data.of_file)[0]
    faster = _faster(source, data)
    if faster > TELLING and faster > like + (1 - like) / 2:
        raise TrajectoryError(
            f"with times a thousand times shorter the efforts are those of the robot's file (correlation "
            f"{faster:.3f} instead of {like:.3f}): milliseconds? Times are in s", file=file, column="time",
        )  # fmt: skip


def _faster(source: Source, data: Rows) -> float:
    """Return how far measured efforts are those of the same path a thousand times faster; 0 if unknown."""
    log, every = data.log, source.every_of(data.log)
    pick = np.linspace(0, len(data.time) - 1, min(TESTED, len(data.time))).astype(int)
    at = pick * every + every // 2
    motion = log.motion[0][at], 1e3 * log.motion[1][at], 1e6 * log.motion[2][at]
    try:
        predicted = source.regress(motion, 1)[2]
    except HybridynError:
        return 0.0
    return _alike(data.measured[pick], predicted)[0]


def _alike(measured: Array, predicted: Array) -> tuple[float, float]:
    """Return the correlation of efforts (their cosine), and the factor between them."""
    sizes = float(np.linalg.norm(measured)), float(np.linalg.norm(predicted))
    if not min(sizes):
        return 0.0, 1.0
    dot = float(np.vdot(measured, predicted))
    return abs(dot) / sizes[0] / sizes[1], dot / sizes[1] ** 2
