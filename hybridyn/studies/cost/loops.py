"""Measure the time to close loops, and the error of efforts with loops closed only to a tolerance."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

from ...effects.choice import Effects
from ...linkage.newton import LoopProblem, close
from ...spatial import Array
from ...structure.module import Module
from ...structure.robot import HybridRobot
from .generated import generated_idm
from .points import Point, timed

#: Closure residuals that are tried, relative to the module's length.
CLOSING_TOLERANCES = (1e-3, 1e-5, 1e-7, 1e-9, 1e-11, 1e-13)

#: Largest number of Newton steps.
MOST_STEPS = 12

LINE = "loops closed to a tolerance"


def by_closing(
    robot: HybridRobot, q: Array, v: Array, a: Array, effects: Effects, error: Callable[[Array], float]
) -> Iterator[Point]:
    """Measure efforts with loops that Newton's method closes to a tolerance, starting at the sample before.

    The generated C model accepts loops only up to the residual that its guard allows. The limit of float32 is
    larger than that of float64. Tolerances that neither accepts are measured for comparison.

    Args:
        q: Positions, assembled, shape (T, nq).
        v: Rates, shape (T, nv).
        a: Accelerations, shape (T, nv).
        error: Computes the error of efforts.
    """
    looped = [Newton(module, q) for module in robot.modules if module.mechanism.closures.rows]
    if not looped or len(q) < 2:
        return
    for tolerance in CLOSING_TOLERANCES:
        posture, seconds = q.copy(), 0.0
        for newton in looped:
            seconds += newton.until(tolerance, posture) / len(q)
        for dtype in ("float64", "float32"):
            model = generated_idm(robot, effects, dtype)
            if isinstance(model, str):
                yield Point(LINE, f"{tolerance:.0e}", np.inf, seconds, "", model)
                break
            tau, guard = model(posture, v, a)
            if guard <= 1.0 or dtype == "float32":
                yield _point(tolerance, dtype, guard, error(tau), seconds)
                break


def _point(tolerance: float, dtype: str, guard: float, error: float, seconds: float) -> Point:
    """Return the point of a tolerance; its time is that of closing alone."""
    what = f"close loops to {tolerance:.0e} only and compute in C ({dtype})"
    how = f"# loops closed to {tolerance:.0e} by Newton from the sample before, then "
    call = f'hybridyn.compile(robot, effects, dtype="{dtype}").idm'
    use = "program" if guard <= 1.0 else "comparison"
    setting = f"{tolerance:.0e}, C in {dtype}"
    return Point(LINE, setting, error, seconds, how + call, use=use, what=what, own=seconds)  # type: ignore[arg-type]


class Newton:
    """Newton's steps on one module's loops, for all samples at once. Each number of steps is timed once."""

    def __init__(self, module: Module, q: Array) -> None:
        """Start every sample from the posture of the sample before, with the motors at their positions.

        Args:
            q: Positions of the robot, assembled, shape (T, nq).
        """
        m = module.mechanism
        own = q[:, module.q_index]
        x = m.cut.positions(own)
        self.start = np.concatenate([x[:1], x[:-1]])
        free = np.ones(m.tree.nv, dtype=bool)
        held = module.motor_columns if len(module.motor_columns) <= m.mobility else module.motor_columns[:0]
        free[held] = False
        for at, to in zip(m.tree.q_slices, m.tree.v_slices, strict=True):
            if to.start in held:
                self.start[:, at] = x[:, at]
        r = m.reduction
        self.module, self.scale = module, r.row_scale
        self.problem = LoopProblem(m.closures, r.row_scale, r.col_scale, free, (), r.rank)
        self.taken = [(self.start, 0.0)]

    def until(self, tolerance: float, q: Array) -> float:
        """Step until the closure residual of every sample is within a tolerance.

        Args:
            tolerance: The tolerance, relative to the module's length.
            q: Positions of the robot, shape (T, nq); those of the module are overwritten.

        Returns:
            Time of the steps [s].
        """
        m = self.module.mechanism
        for steps in range(MOST_STEPS + 1):
            posture, seconds = self._after(steps)
            residual = m.closures.residual(posture, m.tree.sweep(posture)) * self.scale
            if np.abs(residual).max(initial=0.0) <= tolerance:
                break
        own = q[:, self.module.q_index]
        m.cut.positions_to_spanning(posture, own)
        q[:, self.module.q_index] = own
        return seconds

    def _after(self, steps: int) -> tuple[Array, float]:
        """Return the postures after a number of steps, and the time of these steps [s]."""
        while len(self.taken) <= steps:
            number = len(self.taken)
            step = partial(close, self.problem, self.start, np.arange(len(self.start)), iterations=number)
            closed, seconds = timed(step, 3)
            self.taken.append((closed.q, max(seconds, self.taken[-1][1])))
        return self.taken[steps]
