"""From a log to the rows of tau = Y base + known: loops closed, rows thinned."""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy import interpolate

from ..assembly.assemble import assemble
from ..compiled import CompiledRobot
from ..errors import ModelError, TrajectoryError
from ..spatial import Array
from ..structure.robot import HybridRobot
from .logs import Log
from .regressor import done_together, effort_rows
from .signals import Triple, means, processed
from .sought import Sought

#: Entries of the whole regressor that are held at once.
ENTRIES = 4_000_000
#: Samples of a second after thinning, per hertz of the band: more tell hardly more.
PER_HERTZ = 4.0
#: Rows for each parameter that thinning leaves.
LEAST_EACH = 20
#: Samples that thinning leaves, so that a spectrum shows what is no noise.
LEAST = 500


@dataclass(frozen=True, eq=False)
class LogRows:
    """Thinned rows of a log; all efforts are what the motors do together.

    Attributes:
        log: The processed log.
        time: Times, shape (T,), [s].
        Y: Regressor of the base parameters, shape (T, motors, rank).
        known: Efforts by what is held, shape (T, motors).
        of_file: Efforts by the numbers of the robot's file, shape (T, motors).
        of_each: Part of each motor's effort or current, a column each, shape (T, motors, motors).
        together: Pi of redundant motors (`regressor.done_together`), shape (T, motors, motors), or None.
    """

    log: Log
    time: Array
    Y: Array
    known: Array
    of_file: Array
    of_each: Array
    together: Array | None

    @property
    def measured(self) -> Array:
        """Efforts or currents, shape (T, motors)."""
        return np.asarray(self.of_each.sum(axis=2))


class Lines(NamedTuple):
    """Rows of a motion, whose efforts are not known.

    Attributes:
        Y: As in `LogRows`, like the next two.
        known: Shape (T, motors).
        of_file: Shape (T, motors).
        together: Pi of every sample, before they are thinned, shape (T every, motors, motors), or None.
    """

    Y: Array
    known: Array
    of_file: Array
    together: Array | None


@dataclass(frozen=True, eq=False)
class LogSource:
    """How logs become rows.

    Attributes:
        robot: The robot.
        sought: What is to be identified.
        compiled: Compiled models, or None; as in `identify`, like all that follow.
        band: Band of the positions [Hz], or None.
        period: Period of the motion [s], or None.
        every: Samples that are averaged, or None.
    """

    robot: HybridRobot
    sought: Sought
    compiled: CompiledRobot | None
    band: float | None = None
    period: float | None = None
    every: int | None = None

    def rows(self, log: Log) -> LogRows:
        """Filter, differentiate, close the loops, and compute the rows of a log."""
        done = processed(log, band=self.band, period=self.period)
        every = self.every_of(done)
        found = self.regress(done.motion, every)
        remarks = [f"means of {every} samples: {1 / done.step / every:.4g} a second"]
        if found.together is not None:
            remarks.append("redundant motors: what they do together is compared, not what each does")
        done = replace(done, remarks=(*done.remarks, *remarks))
        time, (of_each, together) = means(done.time, every), _thinned(done.effort, found.together, every)
        return LogRows(done, time, found.Y, found.known, found.of_file, of_each, together)

    def every_of(self, log: Log) -> int:
        """Return how many samples are averaged."""
        if self.every is not None:
            return min(self.every, len(log.time))
        if log.band is None:
            return 1
        enough = len(log.time) * len(self.robot.motors) / (LEAST_EACH * len(self.sought.model.names))
        return max(1, int(min(1 / log.step / (PER_HERTZ * log.band), enough, len(log.time) / LEAST)))

    def regress(self, motion: Triple, every: int) -> Lines:
        """Compute the rows of the motors' motion, thinned."""
        parts: list[Triple] = []
        projectors: list[Array] = []
        guess, p = None, len(self.sought.model.standard.names)
        step = max(1, ENTRIES // (len(self.robot.motors) * p) // every) * every
        rows = len(motion[0]) // every * every
        for first in range(0, rows, step):
            x, x_dot, x_ddot = (level[first : min(first + step, rows)] for level in motion)
            q, v, a = self.closed((x, x_dot, x_ddot), guess)
            guess = q[-1]
            Y, held, of_file = (means(values, every) for values in self.of_states(q, v, a))
            parts.append((Y, held, of_file))
            if (together := done_together(self.robot, q)) is not None:
                projectors.append(together)
        Y, held, of_file = (np.concatenate(part) for part in zip(*parts, strict=True))
        return Lines(Y, held, of_file, np.concatenate(projectors) if projectors else None)

    def of_states(self, q: Array, v: Array, a: Array) -> Triple:
        """Compute Y, efforts by what is held and those by the file's numbers at closed states."""
        standard = self.sought.model.standard
        Y = effort_rows(self.robot, standard, q, v, a, together=True)
        return self.sought.columns(Y), Y @ self.sought.constant, Y @ standard.values

    def closed(self, motors: Triple, guess: Array | None) -> Triple:
        """Close the loops for a measured motion, the nearest of redundant motors; return q, v, a."""
        if self.compiled is not None:
            return self.compiled.assemble(motors=motors, guess=guess, nearest=True)
        return assemble(self.robot, motors=motors, guess=guess, nearest=True)

    def instruments(self, reference: Log, data: LogRows) -> Array:
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
        return self.regress(motion, self.every_of(data.log)).Y


def _thinned(effort: Array, together: Array | None, every: int) -> tuple[Array, Array | None]:
    """Return each motor's part of what motors do together, thinned, and Pi, (T, motors, motors) each."""
    if together is None:
        return means(effort, every)[:, None, :] * np.eye(effort.shape[1]), None
    return means(together * effort[: len(together), None, :], every), means(together, every)


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
        if not robot.records[name].kind.single:
            raise ModelError(f"motor '{name}' has several freedoms: no log has columns for it", element=name)
