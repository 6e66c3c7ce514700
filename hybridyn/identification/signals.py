"""Signals of a log: motors' positions and efforts as people record them, filtered and differentiated.

Positions are filtered forwards and backwards, so that nothing is delayed, and differentiated centrally; or,
where the motion is periodic, its Fourier series is fitted and differentiated exactly. Efforts and regressor
are thinned in parallel, by means of blocks: the mean of white noise stays white, and what is filtered on
both sides of tau = Y x changes no x.
"""

from dataclasses import replace

import numpy as np
from scipy import interpolate, signal

from ..errors import TrajectoryError
from ..spatial import Array
from .logs import Log
from .series import DEGREE, FEWEST, GAP

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
#: Samples that lie farther apart [s] are rather told in milliseconds.
SLOW = 0.5
#: A position is an outlier above this multiple of the median and above this part of the travel.
SPIKE, SPIKE_PART = 20.0, 1e-3

#: Positions, velocities and accelerations, shape (T, n) each.
Triple = tuple[Array, Array, Array]


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
        return _at_efforts(replace(log, remarks=(*log.remarks, "rates and accelerations as recorded")))
    position, spikes = without_spikes(log.position)
    rate = 1.0 / log.step
    band = band or _band(position, rate)
    if not 0 < band <= WIDEST * rate:
        raise TrajectoryError(
            f"the band of {band:g} Hz must lie between 0 and {WIDEST:g} of the rate, {WIDEST * rate:g} Hz"
            f"{_other_times(log.step)}",
            file=log.file,
        )
    found = (f"{spikes} outliers of positions replaced",) if spikes else ()
    log = replace(log, band=band, remarks=(*log.remarks, *found))
    return _filtered(log, position, band) if period is None else _fitted(log, position, band, period)


def _fitted(log: Log, position: Array, band: float, period: float) -> Log:
    """Return a log with the Fourier series of its positions, shape (T, motors), and the rates of that."""
    time = log.time if log.at is None else log.at
    x, x_dot, x_ddot = _series(log, position, band, period, time)
    count = int(band * period + 1e-9)
    said = f"Fourier series of {count} harmonics of {1 / period:.4g} Hz fitted and differentiated"
    return replace(log, time=time, at=None, position=x, rates=(x_dot, x_ddot), remarks=(*log.remarks, said))


def _filtered(log: Log, position: Array, band: float) -> Log:
    """Return a log with its positions, shape (T, motors), filtered without phase, and their differences."""
    rate = 1.0 / log.step
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
    said = (
        f"positions filtered forwards and backwards by a Butterworth filter of order {ORDER}, band "
        f"{band:.4g} Hz, and differentiated centrally; {edge} samples left out at each end"
    )
    kept = slice(edge, len(log.time) - edge)
    done = replace(
        log, time=log.time[kept], position=smooth[kept], rates=(rates[0][kept], rates[1][kept]),
        remarks=(*log.remarks, said),
    )  # fmt: skip
    return replace(done, effort=log.effort[kept]) if log.at is None else _at_efforts(done)


def _at_efforts(log: Log) -> Log:
    """Return a processed log with the motion at the times of the efforts."""
    if log.at is None:
        return log
    kept = (log.at >= log.time[0]) & (log.at <= log.time[-1])
    at, motion = log.at[kept], np.hstack(log.motion)
    values = interpolate.make_interp_spline(log.time - log.time[0], motion, k=DEGREE)(at - log.time[0])
    x, x_dot, x_ddot = np.split(values, 3, axis=1)
    return replace(log, time=at, at=None, position=x, rates=(x_dot, x_ddot), effort=log.effort[kept])


def _other_times(step: float) -> str:
    """Return a question for times so far apart that no robot's motion is told by them."""
    return f"; samples lie {step:g} s apart: milliseconds? Times are in s" if step >= SLOW else ""


def _band(position: Array, rate: float) -> float:
    """Choose a band from the spectrum of the positions."""
    frequency, power = signal.periodogram(position, rate, window="hann", axis=0)
    of_all = np.cumsum(power / power.sum(axis=0), axis=0).min(axis=1)
    return float(min(BANDS * frequency[np.searchsorted(of_all, POWER)], WIDEST * rate))


def _series(log: Log, position: Array, band: float, period: float, at: Array) -> Triple:
    """Fit a Fourier series to positions, shape (T, motors), and return it at times with two derivatives."""
    if log.time[-1] - log.time[0] + GAP * log.step < period:
        raise TrajectoryError(f"the log is shorter than its period, {period:g} s", file=log.file)
    time, count = log.time - log.time[0], int(band * period + 1e-9)
    if not count:
        raise TrajectoryError(
            f"the band of {band:g} Hz holds no harmonic of a period of {period:g} s{_other_times(log.step)}",
            file=log.file,
        )
    phase = 2 * np.pi / period * np.outer(time, np.arange(1, count + 1))
    of_all = np.column_stack([np.ones(len(time)), np.cos(phase), np.sin(phase)])
    x = np.linalg.lstsq(of_all, position, rcond=None)[0]
    return fourier(x[0], x[1 : 1 + count], x[1 + count :], period, at - log.time[0])


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
