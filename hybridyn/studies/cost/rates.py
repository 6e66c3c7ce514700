"""Measure error and time of rates and accelerations that a spline or differences compute from positions."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from ...dynamics.inverse import idm
from ...effects.choice import Effects
from ...errors import HybridynError
from ...spatial import Array
from ...structure.robot import HybridRobot
from ...tables.rates import derivatives
from .points import Point, timed

#: Number of rows at either end that are ignored, since the rates of a spline are inaccurate there.
EDGE = 40

#: If efforts differ by less than this (relative), the table had no rates: its rates are those of the spline.
SAME_RULE = 1e-12

LINE = "rates of the trajectory"


def by_rates(
    robot: HybridRobot, time: Array | None, q: Array, v: Array, a: Array, effects: Effects,
    close: Callable[..., tuple[Array, Array, Array]],
) -> Iterator[Point]:  # fmt: skip
    """Compare rates from a spline and from differences of the motors' positions with those of the table.

    Args:
        time: Times, shape (T,), [s], or None.
        q: Positions, shape (T, nq).
        v: Rates, shape (T, nv).
        a: Accelerations, shape (T, nv).
        close: Closes the loops like `hybridyn.assemble`, but for the robot.
    """
    kinds = {robot.kinds[robot.joint_index[motor]] for motor in robot.motors}
    obstacle = ""
    if time is None or len(time) < 3 * EDGE:
        obstacle = f"not measured: needs times and {3 * EDGE} rows or more"
    elif robot.base != "fixed" or kinds - {"revolute", "prismatic"}:
        obstacle = "not measured: needs a fixed base and motors on revolute and prismatic joints"
    if obstacle or time is None:
        yield Point(LINE, "spline, differences", np.inf, np.inf, "", obstacle)
        return
    x, inner = q[:, robot.motor_q], slice(EDGE, len(time) - EDGE)
    wanted = idm(robot, q[inner], v[inner], a[inner], effects=effects)
    peak = np.abs(wanted).max(axis=0)
    rules: dict[str, Callable[[], tuple[Array, Array]]] = {
        "quintic spline": partial(derivatives, time, x, slice(0, len(time))),
        "central differences": partial(_differences, time, x),
    }
    against = ""
    for words, rule in rules.items():
        rates, seconds = timed(rule)
        own = seconds / len(time)
        point = Point(
            LINE, words + against, np.inf, own, f"# rates by {words} of the motors' positions",
            use="comparison" if against else "program", what=f"take rates by {words}", own=own,
        )  # fmt: skip
        try:
            moved = close(motors=(x, *rates), guess=q[0])
            off = np.abs(idm(robot, *(one[inner] for one in moved), effects=effects) - wanted)
        except HybridynError as failure:
            yield replace(point, failure=str(failure))
            continue
        error = float((off / np.where(peak > 0, peak, 1.0)).max(initial=0.0))
        if error < SAME_RULE:  # its error is unknown
            against = ", against that spline"
            reason = "the table has no rates: this spline replaces them, and there is nothing to compare with"
            yield replace(point, failure=reason)
            continue
        yield replace(point, error=error)


def _differences(time: Array, x: Array) -> tuple[Array, Array]:
    """Fit rates by central differences."""
    rate = np.gradient(x, time, axis=0)
    return rate, np.gradient(rate, time, axis=0)
