"""Signals of a log: motors' positions and efforts as people record them, filtered and differentiated.

Positions are filtered forwards and backwards, so that nothing is delayed, and differentiated centrally; or,
where the motion is periodic, its Fourier series is fitted and differentiated exactly. Efforts and regressor
are thinned in parallel, by means of blocks: the mean of white noise stays white, and what is filtered on
both sides of tau = Y x changes no x.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy import signal

from ..description.names import did_you_mean, listed
from ..errors import TrajectoryError
from ..spatial import Array
from ..structure.robot import HybridRobot
from ..tables.opening import open_table

#: Order of the Butterworth filter, which runs twice: a quarter of its band passes to 2e-5, half to 4e-3.
ORDER = 4
#: Periods of the band that are left out at each end, where the filter swings in: to 1e-6.
ENDS = 4.0
#: The band is this multiple of the frequency below which 99 % of the power of the positions lies.
BANDS, POWER = 10.0, 0.99
#: Largest band, of the rate of the samples.
WIDEST = 0.4
#: Central differences of order eight: error (2 pi f / rate)^8 / 630 and / 3150.
FIRST = np.array([-1 / 280, 4 / 105, -1 / 5, 4 / 5, 0, -4 / 5, 1 / 5, -4 / 105, 1 / 280])
SECOND = np.array([-1 / 560, 8 / 315, -1 / 5, 8 / 5, -205 / 72, 8 / 5, -1 / 5, 8 / 315, -1 / 560])
#: A position is an outlier above this multiple of the median and above this part of the travel.
SPIKE, SPIKE_PART = 20.0, 1e-3
#: Largest variation of the time step.
UNEVEN = 0.01
#: A motor moves if its travel is above this part of that of the motor of its kind that moves most.
MOVES = 1e-4
#: Fewest samples: the filter swings in and out, and a spectrum needs some.
FEWEST = 50

#: Positions, velocities and accelerations, shape (T, n) each.
Triple = tuple[Array, Array, Array]


@dataclass(frozen=True, eq=False)
class Log:
    """What was recorded of a motion: positions and efforts of the motors, evenly in time.

    Attributes:
        file: Name of the table, or None.
        time: Times, shape (T,), [s].
        position: Positions, shape (T, motors), [m or rad].
        rates: Velocities and accelerations, shape (T, motors) each; None where they are to be computed.
        effort: Efforts [N or N m], or currents, shape (T, motors); zero for a commanded motion.
        currents: Whether the efforts are currents.
        band: Band of the positions [Hz], once they are filtered.
        remarks: What was done to the signals.
    """

    file: str | None
    time: Array
    position: Array
    rates: tuple[Array, Array] | None
    effort: Array
    currents: bool = False
    band: float | None = None
    remarks: tuple[str, ...] = ()

    @property
    def step(self) -> float:
        """Time between two samples [s]."""
        return float((self.time[-1] - self.time[0]) / (len(self.time) - 1))

    @property
    def motion(self) -> Triple:
        """Positions, velocities and accelerations of a processed log, shape (T, motors) each."""
        assert self.rates is not None
        return self.position, *self.rates


def read_log(robot: HybridRobot, table: Any, *, efforts: bool = True) -> Log:
    """Read the motors' columns of a table; all other columns are left alone.

    Args:
        table: A file (CSV or Parquet), a mapping of columns, or a table with named columns: 'time',
            '<motor>/position', and '<motor>/effort' or '<motor>/current'; with '<motor>/velocity' and
            '<motor>/acceleration' nothing is differentiated.
        efforts: Whether efforts are needed.

    Raises:
        TrajectoryError: A column is missing, times are uneven, samples are too few or a motor never moves.
    """
    file, columns = _columns(table)

    def of(quantity: str) -> Array | None:
        """Return the columns of all motors, or None if no motor has one."""
        names = [f"{motor}/{quantity}" for motor in robot.motors]
        absent = [name for name in names if name not in columns]
        if len(absent) == len(names):
            return None
        if absent:
            raise TrajectoryError(
                f"is missing{did_you_mean(absent[0], columns)}: every motor needs one",
                file=file, column=absent[0],
            )  # fmt: skip
        rows = {len(columns[name]) for name in ("time", *names) if name in columns}
        if len(rows) > 1:
            raise TrajectoryError(
                f"and others have {min(rows)} to {max(rows)} rows: give columns of one length",
                file=file, column=names[0],
            )  # fmt: skip
        return np.column_stack([np.asarray(columns[name], dtype=float) for name in names])

    position, effort, current = of("position"), of("effort"), of("current")
    rates = of("velocity"), of("acceleration")
    measured = current if effort is None else effort
    wanted = {"time": columns.get("time"), f"{robot.motors[0]}/position": position}
    if efforts:
        wanted[f"{robot.motors[0]}/effort"] = measured
    for name, values in wanted.items():
        if values is None:
            raise TrajectoryError(
                f"is missing{did_you_mean(name, columns)}: identification needs time, position and effort "
                "(or current) of the motors",
                file=file, column=name,
            )  # fmt: skip
    assert position is not None
    log = Log(
        file, np.asarray(columns["time"], dtype=float), position,
        None if rates[0] is None or rates[1] is None else (rates[0], rates[1]),
        np.zeros_like(position) if measured is None else measured, effort is None and current is not None,
    )  # fmt: skip
    _check(robot, log)
    return log


def _columns(table: Any) -> tuple[str | None, Mapping[str, Any]]:
    """Return the name of a table, and its columns by name."""
    if isinstance(table, Mapping) or hasattr(table, "columns"):
        names = table if isinstance(table, Mapping) else table.columns
        return None, {str(name): table[name] for name in names}
    with open_table(table) as opened:
        rows = np.concatenate([np.zeros((0, len(opened.columns))), *(b.values for b in opened.blocks)])
        return opened.file, dict(zip(opened.columns, rows.T, strict=True))


def _check(robot: HybridRobot, log: Log) -> None:
    """Check numbers, times, and that every motor moves."""
    if len(log.time) < FEWEST:
        raise TrajectoryError(
            f"{len(log.time)} samples are too few ({FEWEST} needed): record a longer motion", file=log.file
        )
    arrays = [log.time[:, None], log.position, log.effort, *(log.rates or ())]
    wrong = [np.flatnonzero(~np.isfinite(x).all(axis=1)) for x in arrays]
    if rows := [int(w[0]) + 1 for w in wrong if len(w)]:
        raise TrajectoryError("a number is not finite: leave the row out", file=log.file, row=min(rows))
    steps = np.diff(log.time)
    if not (steps > 0).all() or np.ptp(steps) > 2 * UNEVEN * log.step:
        raise TrajectoryError(
            f"times are uneven: steps of {steps.min():.6g} to {steps.max():.6g} s, which may vary by "
            f"{UNEVEN:.0%}; resample the log at a constant rate",
            file=log.file, column="time",
        )  # fmt: skip
    travel = np.ptp(log.position, axis=0)
    linear = np.array([robot.records[name].kind == "prismatic" for name in robot.motors])
    most = np.array([travel[linear == kind].max() for kind in linear])
    still = [name for name, x, y in zip(robot.motors, travel, most, strict=True) if x <= MOVES * y]
    if still:
        raise TrajectoryError(
            f"{listed(still)} never moves: move every motor (hybridyn.excitation computes such a motion)",
            file=log.file, column=f"{still[0]}/position",
        )  # fmt: skip


def processed(log: Log, *, band: float | None = None, period: float | None = None) -> Log:
    """Return a log with rates and accelerations: filtered without phase, and differentiated.

    Args:
        log: What was recorded; where it has rates and accelerations, it is returned as it is.
        band: Frequency below which positions are kept [Hz]; None chooses it from their spectrum.
        period: Period of the motion [s], if it is periodic: the Fourier series up to `band` is fitted to all
            samples, which need not be whole periods, and differentiated. Nothing is cut off at the ends.

    Raises:
        TrajectoryError: The band is too wide for the samples' rate, or the log is shorter than a period.
    """
    if log.rates is not None:
        return replace(log, remarks=("rates and accelerations as recorded",))
    position, spikes = without_spikes(log.position)
    rate = 1.0 / log.step
    band = band or _band(position, rate)
    if not 0 < band <= WIDEST * rate:
        raise TrajectoryError(
            f"the band of {band:g} Hz must lie between 0 and {WIDEST:g} of the rate, {WIDEST * rate:g} Hz",
            file=log.file,
        )
    remarks = [f"{spikes} outliers of positions replaced"] if spikes else []
    if period is not None:
        x, x_dot, x_ddot = _series(log, position, band, period)
        count = int(band * period + 1e-9)
        remarks.append(
            f"Fourier series of {count} harmonics of {1 / period:.4g} Hz fitted and differentiated"
        )
        return replace(log, position=x, rates=(x_dot, x_ddot), band=band, remarks=tuple(remarks))
    sections = signal.butter(ORDER, band, fs=rate, output="sos")
    edge = int(np.ceil(ENDS * rate / band)) + len(FIRST)
    if len(log.time) < 2 * edge + FEWEST:
        raise TrajectoryError(
            f"{len(log.time)} samples are too few: the filter of {band:g} Hz takes {edge} at each end; "
            "record a longer motion, or choose a wider band",
            file=log.file,
        )
    smooth = signal.sosfiltfilt(sections, position, axis=0, padlen=edge)
    rates = [
        signal.oaconvolve(smooth, weights[:, None], mode="same", axes=0) * rate**order
        for order, weights in ((1, FIRST), (2, SECOND))
    ]
    remarks.append(
        f"positions filtered forwards and backwards by a Butterworth filter of order {ORDER}, band "
        f"{band:.4g} Hz, and differentiated centrally; {edge} samples left out at each end"
    )
    kept = slice(edge, len(log.time) - edge)
    return replace(
        log, time=log.time[kept], position=smooth[kept], rates=(rates[0][kept], rates[1][kept]),
        effort=log.effort[kept], band=band, remarks=tuple(remarks),
    )  # fmt: skip


def _band(position: Array, rate: float) -> float:
    """Choose a band from the spectrum of the positions."""
    frequency, power = signal.periodogram(position, rate, window="hann", axis=0)
    of_all = np.cumsum(power / power.sum(axis=0), axis=0).min(axis=1)
    return float(min(BANDS * frequency[np.searchsorted(of_all, POWER)], WIDEST * rate))


def _series(log: Log, position: Array, band: float, period: float) -> Triple:
    """Fit a Fourier series to positions, shape (T, motors), and return it with two derivatives."""
    if log.time[-1] - log.time[0] + log.step < period * (1 - 1e-9):
        raise TrajectoryError(f"the log is shorter than its period, {period:g} s", file=log.file)
    time, count = log.time - log.time[0], int(band * period + 1e-9)
    phase = 2 * np.pi / period * np.outer(time, np.arange(1, count + 1))
    of_all = np.column_stack([np.ones(len(time)), np.cos(phase), np.sin(phase)])
    x = np.linalg.lstsq(of_all, position, rcond=None)[0]
    return fourier(x[0], x[1 : 1 + count], x[1 + count :], period, time)


def fourier(mean: Array, cosine: Array, sine: Array, period: float, time: Array) -> Triple:
    """Compute a Fourier series and two derivatives, shape (T, n) each.

    Args:
        mean: Shape (n,).
        cosine: Coefficients of cos(k w t), shape (harmonics, n).
        sine: Coefficients of sin(k w t), shape (harmonics, n).
        period: 2 pi / w [s].
        time: Shape (T,), [s].
    """
    w = 2 * np.pi / period * np.arange(1, len(cosine) + 1)[:, None]
    c, s = np.cos(time[:, None] * w[:, 0]), np.sin(time[:, None] * w[:, 0])
    x_dot, x_ddot = c @ (w * sine) - s @ (w * cosine), -c @ (w**2 * cosine) - s @ (w**2 * sine)
    return mean + c @ cosine + s @ sine, x_dot, x_ddot


def without_spikes(values: Array) -> tuple[Array, int]:
    """Replace single outliers of smooth signals, shape (T, n), by cubics through their neighbours.

    Returns:
        The signals, and the number of outliers.
    """
    out, count = values.copy(), 0
    for column in out.T:
        fourth = np.abs(np.convolve(column, [1, -4, 6, -4, 1], mode="same")) / 6
        fourth[:2] = fourth[-2:] = 0.0
        limit = max(SPIKE * float(np.median(fourth)), SPIKE_PART * float(np.ptp(np.sort(column)[2:-2])))
        for i in np.flatnonzero(fourth > limit):
            if fourth[i] == fourth[max(i - 2, 0) : i + 3].max():
                column[i] = (4 * (column[i - 1] + column[i + 1]) - column[i - 2] - column[i + 2]) / 6
                count += 1
    return out, count


def means(values: Array, every: int) -> Array:
    """Return the means of blocks of `every` rows, shape (T // every, ...)."""
    rows = len(values) // every * every
    return np.asarray(values[:rows].reshape(-1, every, *values.shape[1:]).mean(axis=1))
