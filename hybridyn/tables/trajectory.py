"""Convert the rows of a table to the motion of joints and platforms, block by block."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..description.records import Array
from ..errors import TrajectoryError
from ..joints.kinds import QUATERNION, SPIN
from ..spatial import quaternion_from_vector
from .layout import Layout
from .opening import Block, Table
from .rates import FEWEST_ROWS, HALO, Window, aligned, angular_rates, derivatives, turns, windows
from .signals import VECTOR, Signal

#: Largest deviation of a quaternion's length from one; seven digits in a file suffice.
QUATERNION_TOLERANCE = 1e-6
#: Largest rotation between two rows for a fit [rad]: near half a turn its direction is ambiguous.
LARGEST_TURN = 2.0 * np.pi / 3.0

Triple = tuple[Array, Array, Array]  # position, velocity, acceleration
#: A whole pose or its rates, shape (T, 7) or (T, 6), or some coordinates by name, shape (T,) each.
Parts = Array | dict[str, Array]
#: First and second derivatives of a signal's samples, shape (T, n) each.
Fits = dict[Signal, tuple[Array, Array]]


class TableMotion(NamedTuple):
    """The motion in some consecutive rows of a table.

    Attributes:
        first_row: Number of the first row in the table (from 1).
        size: Number of rows.
        time: Times, shape (T,), [s], or None.
        joints: Position, velocity and acceleration by joint, shape (T,) each, or (T, n).
        platforms: Pose, velocity and acceleration by link, as `hybridyn.assemble` takes them.
        wrenches: Wrenches by link, shape (T, 6), [N, N m], in the link's frame.
        efforts: Efforts by joint, shape (T,), [N or N m].
    """

    first_row: int
    size: int
    time: Array | None
    joints: dict[str, Triple]
    platforms: dict[str, tuple[Parts, Parts, Parts]]
    wrenches: dict[str, Array]
    efforts: dict[str, Array]

    def part(self, start: int, stop: int) -> TableMotion:
        """Return a copy of the rows from `start` to before `stop`, counted from 0.

        The copy is contiguous: NumPy's sine of strided numbers differs in the last bit from that of
        contiguous ones, and rows pickled for another process would give other results.
        """
        rows = slice(start, stop)
        size = len(range(self.size)[rows])
        content = _each(lambda x: np.array(x[rows], order="C"), self._content())
        return TableMotion(self.first_row + start, size, *content)

    @staticmethod
    def joined(parts: Sequence[TableMotion]) -> TableMotion:
        """Return the rows of consecutive parts of a table."""
        content = _each(lambda *x: np.concatenate(x), *(part._content() for part in parts))
        return TableMotion(parts[0].first_row, sum(part.size for part in parts), *content)

    def _content(self) -> tuple[Any, ...]:
        return self.time, self.joints, self.platforms, self.wrenches, self.efforts


def _each(function: Callable[..., Any], *trees: Any) -> Any:
    """Apply a function to the arrays of equal trees of dicts and tuples; None stays None."""
    first = trees[0]
    if isinstance(first, dict):
        return {key: _each(function, *(tree[key] for tree in trees)) for key in first}
    if isinstance(first, tuple):
        return tuple(_each(function, *branches) for branches in zip(*trees, strict=True))
    return None if first is None else function(*trees)


def read_motions(table: Table, layout: Layout) -> Iterator[TableMotion]:
    """Convert the rows of a table to motions, block by block, and fit missing rates.

    Missing velocities are derivatives of a spline through the positions; missing accelerations are those of
    a spline through the velocities where the table has these, else through the positions (`rates.py`). They
    do not depend on the block size.

    Args:
        table: The table; no block is read yet.
        layout: The meaning of its columns.

    Raises:
        TrajectoryError: Time does not increase, a quaternion is not normalised, or rows are too few or too
            coarse for the rates to be fitted.
    """
    file = layout.file
    fitted = any(signal.missing for signal in layout.signals)
    for window in windows(_checked(table, layout), HALO if fitted else 0):
        time = None if layout.time is None else window.values[:, layout.time]
        if fitted and len(window.values) < FEWEST_ROWS:
            message = f"{len(window.values)} rows are too few to fit the missing rates ({FEWEST_ROWS} needed)"
            raise TrajectoryError(f"{message}; give velocities and accelerations", file=file)
        fits = _fits(layout, window, time) if fitted else {}
        own = window.values[window.core]
        yield TableMotion(
            first_row=window.first_row,
            size=len(own),
            time=None if time is None else time[window.core],
            joints={name: _joint(signal, window, fits, file) for name, signal in layout.joints.items()},
            platforms={key: _platform(signal, window, fits, file) for key, signal in layout.poses.items()},
            wrenches={link: own[:, list(columns)] for link, columns in layout.wrenches.items()},
            efforts={joint: own[:, column] for joint, column in layout.efforts.items()},
        )


def _checked(table: Table, layout: Layout) -> Iterator[Block]:
    """Yield blocks after checking that times increase and quaternions have length one."""
    last = -np.inf
    for block in table.blocks:
        if layout.time is not None:
            times = np.concatenate([[last], block.values[:, layout.time]])
            for i in np.flatnonzero(times[1:] <= times[:-1]):
                message = f"{float(times[i + 1])!r} s does not come after {float(times[i])!r} s"
                row = block.first_row + int(i)
                raise TrajectoryError(message, file=layout.file, row=row, column="time")
            last = times[-1]
        for signal in layout.signals:
            if "qx" in signal.components:
                _check_quaternions(block, signal, table.columns, layout.file)
        yield block


def _check_quaternions(block: Block, signal: Signal, columns: Sequence[str], file: str | None) -> None:
    part = list(signal.position[signal.components.index("qx") :])
    with np.errstate(over="ignore"):  # an infinite length is an error, too
        lengths = np.linalg.norm(block.values[:, part], axis=1)
    wrong = np.flatnonzero(~(np.abs(lengths - 1.0) <= QUATERNION_TOLERANCE))
    if len(wrong):
        message = (
            f"the quaternion has length {lengths[wrong[0]]:.9g}, not 1 (within {QUATERNION_TOLERANCE:g})"
        )
        row = block.first_row + int(wrong[0])
        raise TrajectoryError(message, file=file, row=row, column=columns[part[0]])


def _joint(signal: Signal, window: Window, fits: Fits, file: str | None) -> Triple:
    triple = _levels(signal, window, fits, file)
    return triple if len(signal.components) > 1 else (triple[0][:, 0], triple[1][:, 0], triple[2][:, 0])


def _platform(signal: Signal, window: Window, fits: Fits, file: str | None) -> tuple[Parts, Parts, Parts]:
    pose, velocity, acceleration = _levels(signal, window, fits, file)
    places = rates = signal.components
    if signal.turn:
        part = pose[:, signal.lengths :]
        pose = np.hstack([pose[:, : signal.lengths], part / np.linalg.norm(part, axis=1, keepdims=True)])
        if signal.lengths == 3 and not signal.lacks:
            return pose, velocity, acceleration
        own = places[: signal.lengths]
        places, rates = (*own, *QUATERNION), (*own, *SPIN)
    return (
        dict(zip(places, pose.T, strict=True)),
        dict(zip(rates, velocity.T, strict=True)),
        dict(zip(rates, acceleration.T, strict=True)),
    )


def _positions(signal: Signal, values: Array) -> Array:
    """Return the positions of a signal, a rotation vector as a quaternion, shape (rows, n)."""
    out: Array = values[:, list(signal.position)]
    if signal.turn == VECTOR:
        turned = quaternion_from_vector(out[:, signal.lengths :])
        out = np.hstack([out[:, : signal.lengths], turned])
    return out


def _check_turns(signal: Signal, window: Window, file: str | None) -> None:
    """Check that orientations rotate little enough between two rows for a fit."""
    angles = turns(_positions(signal, window.values)[:, signal.lengths :])
    index = int(np.argmax(angles))
    if angles[index] > LARGEST_TURN:
        row = window.first_row - window.core.start + index + 1
        message = (
            f"'{signal.name}' turns by {np.degrees(angles[index]):.0f} degrees since the row before, too far "
            f"to fit its velocity ({np.degrees(LARGEST_TURN):.0f} at most); give velocities or more rows"
        )
        raise TrajectoryError(message, file=file, row=row, column=f"{signal.name}/pose/{signal.turn[0]}")


def _levels(signal: Signal, window: Window, fits: Fits, file: str | None) -> Triple:
    """Return position, velocity and acceleration of a block's own rows, fitted where columns are missing."""
    own = window.values[window.core]
    rates: list[Any] = [
        None if at is None else own[:, list(at)] for at in (signal.velocity, signal.acceleration)
    ]
    position, (velocity, acceleration) = _positions(signal, own), rates
    if signal.missing:
        first, second = fits[signal]
        if velocity is not None:
            second = first
        elif signal.turn:
            n = signal.lengths
            quaternions = aligned(_positions(signal, window.values)[:, n:])[window.core]
            omega, omega_dot = angular_rates(quaternions, first[:, n:], second[:, n:])
            first, second = np.hstack([first[:, :n], omega]), np.hstack([second[:, :n], omega_dot])
        for row in np.flatnonzero(~np.isfinite(np.hstack([first, second])).all(axis=1)):
            message = f"no finite rates of '{signal.name}' can be fitted around here"
            raise TrajectoryError(message, file=file, row=window.first_row + int(row))
        velocity = first if velocity is None else velocity
        acceleration = second if acceleration is None else acceleration
    return position, velocity, np.zeros_like(velocity) if acceleration is None else acceleration


def _fits(layout: Layout, window: Window, time: Array | None) -> Fits:
    """Fit all signals that lack rates at once, and return two derivatives of their samples by signal."""
    assert time is not None  # read_layout requires it where rates are missing
    signals = [signal for signal in layout.signals if signal.missing]
    for signal in signals:
        if signal.turn and signal.velocity is None:
            _check_turns(signal, window, layout.file)
    samples = [_samples(signal, window.values) for signal in signals]
    try:
        with np.errstate(all="ignore"):  # `_levels` finds what overflows
            first, second = derivatives(
                time, np.hstack(samples), window.core, window.first_row - window.core.start
            )
    except ValueError as error:  # a singular system, or overflow on the way to it
        message = f"the times are too close together or too far apart to fit the rates of '{signals[0].name}'"
        raise TrajectoryError(message, file=layout.file, column="time") from error
    ends = np.cumsum([values.shape[1] for values in samples])[:-1]
    parts = np.split(first, ends, axis=1), np.split(second, ends, axis=1)
    return dict(zip(signals, zip(*parts, strict=True), strict=True))


def _samples(signal: Signal, values: Array) -> Array:
    """Return the samples of a spline: a signal's rates, or positions without jumps, shape (rows, n)."""
    if signal.velocity is not None:
        return values[:, list(signal.velocity)]
    out = _positions(signal, values)
    out[:, list(signal.wraps)] = np.unwrap(out[:, list(signal.wraps)], axis=0)
    if signal.turn:
        out[:, signal.lengths :] = aligned(out[:, signal.lengths :])
    return out
