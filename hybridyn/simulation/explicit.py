"""Explicit Runge-Kutta methods on the constraint manifold.

Within a step the unknowns are the independent coordinates y and velocities u of one chart (`chart.py`),
built at the step's start:

    y_dot = L T(xi)^-1 v(y, u),    u_dot = L a(t, q, v),    L = the chart's `independent`

Every stage is lifted to an assembled posture, at which the direct model is evaluated. Errors are estimated on
q and v. Near postures of lost rank a stage must agree with the motion predicted from the step's start;
otherwise it is on another branch.

Source:
    Butcher tableaus: the classical method; Dormand & Prince (1980). Charts by tangent space: Potra &
    Rheinboldt (1991).
"""

from __future__ import annotations

import contextlib
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..compiled.library.steps import Control, Tableau, Taken
from ..spatial import Array
from .system import Coordinates, State, Stepped, System, in_quickest_chart, weighted


@dataclass(frozen=True, eq=False)
class Explicit:
    """An explicit Runge-Kutta method.

    Attributes:
        order: Order of the method.
        A: Stage weights, shape (stages, stages).
        b: Weights of the result.
        e: Weights of the error estimate over the stages and one more at the result, or None.
    """

    order: int
    A: Array
    b: Array
    e: Array | None

    @cached_property
    def tableau(self) -> Tableau:
        """The method's numbers for steps in C."""
        return Tableau(self.A, self.b, self.e)

    def steps(
        self, system: System, state: State, t: Array, h: float, control: Control | None = None
    ) -> Taken | None:
        """Advance a state by several steps, as long as the compiled path is valid.

        The compiled path takes independent joints as coordinates (`compiled.lift_program`), not those of the
        tangent space at each step's start. The results of both agree to the method's error.

        Args:
            state: The state at the start.
            t: Times of the start and after each step, shape (steps + 1,), [s]; with `control`, only the
                first is read.
            h: Length of the steps, with `control` of the first one [s].
            control: Chooses the lengths of the steps; None for equal ones.

        Returns:
            The states after the steps, fewer than asked for where the general path must take the next one;
            None without a compiled path.
        """
        law = system.law
        if law.steps is None or law.in_c is None or not system.bound:
            return None
        return law.steps.take(self.tableau, law.in_c, (state.q, state.v, state.a), t, h, control)

    def step(self, system: System, state: State, h: float) -> Stepped:
        """Advance a state by h [s], on the compiled path where it is valid.

        Raises:
            AssemblyError: A stage is out of reach.
        """
        taken = self.steps(system, state, np.array([state.t, state.t + h]), h)
        if taken is None or not len(taken.q):
            return self.general_step(system, state, h)
        system.law.evaluations += len(self.b)
        errors = (None, None) if self.e is None or taken.error is None else taken.error
        after = State(state.t + h, taken.q[0], taken.v[0], taken.a[0])
        return Stepped(after, errors[0], errors[1], 0, float(taken.pivot[0]))

    def general_step(self, system: System, state: State, h: float) -> Stepped:
        """Advance a state by h [s] on the general path.

        Raises:
            AssemblyError: A stage is out of reach.
        """
        with system.law.counted_as_general() if system.law.steps else contextlib.nullcontext():
            return in_quickest_chart(system, state, lambda chart: self._step(system, state, h, chart))

    def _step(self, system: System, state: State, h: float, chart: Coordinates) -> Stepped:
        """Advance a state by h [s] in a chart.

        Raises:
            AssemblyError: A stage is out of reach.
        """
        u0 = chart.independent(state.v)
        ky, ku = [u0], [chart.independent(state.a)]
        for row in self.A[1:]:
            y, u = (h * weighted(row, k) for k in (ky, ku))
            t = state.t + h * float(row.sum())
            y_dot, u_dot, _ = system.rates(chart, np.array([t]), [system.posture(chart, t, y, u0 + u, state)])
            ky.append(y_dot[0])
            ku.append(u_dot[0])
        t = state.t + h
        end = system.posture(chart, t, h * weighted(self.b, ky), u0 + h * weighted(self.b, ku), state)
        y_dot, u_dot, a = system.rates(chart, np.array([t]), [end])
        error_q = error_v = None
        if self.e is not None:
            error_q = chart.rates(h * weighted(self.e, [*ky, y_dot[0]]))
            error_v = chart.rates(h * weighted(self.e, [*ku, u_dot[0]]))
        return Stepped(State(t, end.q, end.v, a[0]), error_q, error_v, 0, chart.pivot)


def _rows(*rows: list[float]) -> Array:
    """Build a square lower triangular array from ragged rows."""
    out = np.zeros((len(rows), len(rows)))
    for i, row in enumerate(rows):
        out[i, : len(row)] = row
    return out


RK4 = Explicit(4, _rows([], [1 / 2], [0, 1 / 2], [0, 0, 1]), np.array([1 / 6, 1 / 3, 1 / 3, 1 / 6]), None)
DOPRI5 = Explicit(
    5,
    _rows(
        [], [1 / 5], [3 / 40, 9 / 40], [44 / 45, -56 / 15, 32 / 9],
        [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729],
        [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656],
    ),
    np.array([35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84]),
    np.array([71 / 57600, 0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40]),
)  # fmt: skip
