"""Columns of a log with times of their own, with gaps, and with uneven times.

Filters need positions evenly in time: if they are not, quintic splines through them give them so. Efforts
jump where friction changes its sign, which no spline follows: they stay as they are, and the motion is
computed at their times.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy import interpolate

from ..errors import TrajectoryError
from ..spatial import Array, Index, Mask

#: Largest variation of the time step of an even log.
UNEVEN = 0.01
#: Steps of a series that may be missing together: the spline crosses them.
GAP = 10
#: Degree of the splines.
DEGREE = 5
#: Part of the efforts of a motor that has those of all others in its rows, at least; else clocks differ.
SHARED = 0.5
#: Fewest samples: the filter swings in and out, and a spectrum needs some.
FEWEST = 50


class SeriesRows(NamedTuple):
    """Columns that are used, in the rows in which one has a number.

    Attributes:
        time: Shape (T,), [s].
        values: Shape (T, columns), NaN where there is none.
        there: Whether there is one, shape (T, columns).
    """

    time: Array
    values: Array
    there: Mask


class Series(NamedTuple):
    """Columns at times that they share.

    Attributes:
        time: Shape (T,), [s].
        values: Shape (T, columns).
        remarks: What was done to them.
    """

    time: Array
    values: Array
    remarks: tuple[str, ...] = ()


def used_rows(columns: Mapping[str, Array], names: Sequence[str], file: str | None) -> SeriesRows:
    """Return the rows of some columns, after checks of numbers, times and gaps."""
    time, values = columns["time"], np.column_stack([columns[name] for name in names])
    there = ~np.isnan(values) & ~np.isnan(time)[:, None]
    used = np.flatnonzero(there.any(axis=1))
    _check_rows(time, values, used, file)
    time, values, there = time[used], values[used], there[used]
    for name, own in zip(names, there.T, strict=True):
        _check_gaps(time, own, used, file, name)
    return SeriesRows(time, values, there)


def motion_of(rows: SeriesRows, count: int, rates: bool) -> Series:
    """Return the first columns, those of the motion: as they are, or from splines at even times.

    Args:
        rates: Whether they have rates, so that nothing needs to be even.
    """
    there = rows.there[:, :count]
    own = there.any(axis=1)
    time, steps = rows.time[own], np.diff(rows.time[own])
    mean = float(time[-1] - time[0]) / len(steps)
    even = rates or np.ptp(steps) <= 2 * UNEVEN * mean
    if there[own].all() and even:
        return Series(time, rows.values[own, :count])
    series = [(rows.time[one], column[one]) for one, column in zip(there.T, rows.values.T, strict=False)]
    start, end = max(time[0] for time, _ in series), min(time[-1] for time, _ in series)
    size = min(int(np.sum((time >= start) & (time <= end))) for time, _ in series)
    at = np.linspace(start, end, size)
    splines = (interpolate.make_interp_spline(time - start, x, k=DEGREE) for time, x in series)
    what = "columns have times of their own" if even else "times are uneven"
    remark = (
        f"{what}, {steps.min():.4g} to {steps.max():.4g} s apart: the motion is resampled by quintic splines "
        f"to {(size - 1) / (end - start):.4g} a second"
    )
    return Series(at, np.column_stack([spline(at - start) for spline in splines]), (remark,))


def efforts_of(rows: SeriesRows, count: int, motion: Array) -> Series:
    """Return the columns after those of the motion: efforts, which are not resampled.

    They are those of rows in which all motors have one; or between them, where motors have clocks of their
    own.

    Args:
        motion: Times of the motion, shape (T,), which are returned if they are those of the efforts.
    """
    there, values = rows.there[:, count:], rows.values[:, count:]
    whole = there.all(axis=1)
    if not there.shape[1] or (whole.sum() == len(motion) and (rows.time[whole] == motion).all()):
        return Series(motion, values[whole])
    if whole.sum() >= SHARED * there.sum(axis=0).max():
        return Series(rows.time[whole], values[whole])
    each = [(rows.time[own], x[own]) for own, x in zip(there.T, values.T, strict=True)]
    start, end = max(time[0] for time, _ in each), min(time[-1] for time, _ in each)
    at = motion[(motion >= start) & (motion <= end)]
    remark = "motors' efforts have times of their own: interpolated between them"
    return Series(at, np.column_stack([np.interp(at, *one) for one in each]), (remark,))


def _check_rows(time: Array, values: Array, used: Index, file: str | None) -> None:
    """Check that numbers are finite, samples enough, and that times increase."""
    infinite = np.flatnonzero(np.isinf(values).any(axis=1) | np.isinf(time))
    if len(infinite):
        row = int(infinite[0]) + 1
        raise TrajectoryError("a number is not finite: leave the row out", file=file, row=row)
    if len(used) < FEWEST:
        raise TrajectoryError(
            f"{len(used)} samples are too few ({FEWEST} needed): record a longer motion", file=file
        )
    back = np.flatnonzero(np.diff(time[used]) <= 0)
    if len(back):
        at, before = used[back[0] + 1], used[back[0]]
        raise TrajectoryError(
            f"{float(time[at])!r} s does not come after {float(time[before])!r} s: sort the rows, and keep "
            "one of those with the same time", file=file, row=int(at) + 1, column="time",
        )  # fmt: skip


def _check_gaps(time: Array, there: Mask, used: Index, file: str | None, name: str) -> None:
    """Check that a column has numbers all along."""
    if there.sum() < FEWEST:
        raise TrajectoryError(
            f"has {there.sum()} numbers, too few ({FEWEST} needed): record a longer motion",
            file=file, column=name,
        )  # fmt: skip
    step = float(np.median(np.diff(time[there])))
    own = np.concatenate([time[:1], time[there], time[-1:]])
    longest = int(np.argmax(np.diff(own)))
    gap = float(own[longest + 1] - own[longest])
    if gap > GAP * step:
        row = int(used[min(np.searchsorted(time, own[longest]) + 1, len(used) - 1)]) + 1
        raise TrajectoryError(
            f"has no number for {gap:.4g} s: at most {GAP} of its steps of {step:.4g} s may be missing; cut "
            "the log there", file=file, row=row, column=name,
        )  # fmt: skip
