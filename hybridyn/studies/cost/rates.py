"""Measure error and time of rates and accelerations that a spline or differences compute from positions."""

from __future__ import annotations

from collections.abc import Callable, Iterator
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
    obstacle = _obstacle(time, kinds - {"revolute", "prismatic"}, robot)
    if obstacle or time is None:
        yield Point(LINE, "spline, differences", np.inf, np.inf, "", obstacle)
        return
    p = q[:, robot.motor_q]
    inner = slice(EDGE, len(time) - EDGE)
    wanted = idm(robot, q[inner], v[inner], a[inner], effects=effects)
    peak = np.abs(wanted).max(axis=0)
    peak = np.where(peak > 0, peak, 1.0)

    spline = partial(derivatives, time, p, slice(0, len(time)))

    def differences() -> tuple[Array, Array]:
        """Fit rates by central differences."""
        rate = np.gradient(p, time, axis=0)
        return rate, np.gradient(rate, time, axis=0)

    against = ""
    for words, rule in (("quintic spline", spline), ("central differences", differences)):
        (rate, acceleration), seconds = timed(rule)
        try:
            motors = {m: (p[:, i], rate[:, i], acceleration[:, i]) for i, m in enumerate(robot.motors)}
            moved = close(motors=motors, guess=q[0])
            tau = idm(robot, *(x[inner] for x in moved), effects=effects)
        except HybridynError as failure:
            yield Point(LINE, words, np.inf, np.inf, "", str(failure))
            continue
        off = float((np.abs(tau - wanted) / peak).max(initial=0.0))
        if off < SAME_RULE:  # its error is unknown
            against = ", against that spline"
            reason = "the table has no rates: this spline replaces them, and there is nothing to compare with"
            yield Point(LINE, words, np.inf, np.inf, "", reason)
            continue
        own = seconds / len(time)
        fragment = f"# rates by {words} of the motors' positions"
        what = f"take rates by {words}"
        use = "comparison" if against else "program"
        yield Point(LINE, words + against, off, own, fragment, use=use, what=what, own=own)  # type: ignore[arg-type]


def _obstacle(time: Array | None, odd_kinds: set[str], robot: HybridRobot) -> str:
    """Return the reason why rates cannot be computed from positions, or ""."""
    if time is None or len(time) < 3 * EDGE:
        return f"not measured: needs times and {3 * EDGE} rows or more"
    if robot.base != "fixed" or odd_kinds or not robot.motors:
        return "not measured: needs a fixed base and motors on revolute and prismatic joints"
    return ""
