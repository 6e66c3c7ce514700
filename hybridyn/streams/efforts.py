"""Efforts of a long motion, block by block, with bounded memory."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping

import numpy as np

from ..dynamics.inverse import idm
from ..effects.choice import Effects
from ..errors import HybridynError
from ..spatial import Array
from ..structure.robot import HybridRobot
from .one_pass import rows_at_once


def efforts_in_blocks(
    robot: HybridRobot, q: Array, v: Array, a: Array, on: Effects, *,
    wrenches: Mapping[str, Array] | None = None, time: Array | None = None,
) -> Array:  # fmt: skip
    """Compute motor efforts as `hybridyn.idm` does, block by block.

    Args:
        q: Positions, shape (T, nq).
        v: Rates, shape (T, nv), [m/s, rad/s].
        a: Accelerations, shape (T, nv), [m/s^2, rad/s^2].
        on: Effects to compute.
        wrenches: External wrenches, as for `hybridyn.idm`.
        time: Times, shape (T,), [s], or None.

    Returns:
        Efforts, shape (T, motors), [N or N m].

    Raises:
        HybridynError: As in `hybridyn.idm`, for the first block with an error.
    """
    rows = rows_at_once(robot)
    found = []
    for start in range(0, max(len(q), 1), rows):
        at = slice(start, start + rows)
        outer = {link: W[at] if np.ndim(W) == 2 else W for link, W in (wrenches or {}).items()}
        now = None if time is None else time[at]
        with samples_counted_from(start):
            found.append(idm(robot, q[at], v[at], a[at], wrenches=outer, time=now, effects=on))
    return np.concatenate(found)


@contextlib.contextmanager
def samples_counted_from(start: int) -> Iterator[None]:
    """Shift the sample of an error, so that it counts from the start of the motion."""
    try:
        yield
    except HybridynError as error:
        if error.sample is not None:
            error.sample += start
        raise
