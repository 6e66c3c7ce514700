"""Runge-Kutta methods on the constraint manifold: explicit ones, and an implicit one for stiff scenes.

Within a step the unknowns are the independent coordinates y and velocities u of one chart
(`hybridyn.manifold`), built at the step's start:

    y_dot = L T(xi)^-1 v(y, u),    u_dot = L a(t, q, v),    L = the chart's `independent`

Every stage is lifted to an assembled posture, at which the direct model is evaluated. Errors are estimated on
q and v. Near postures of lost rank a stage must agree with the motion predicted from the step's start;
otherwise it is on another branch.

Source:
    Butcher tableaus: the classical method; Dormand & Prince (1980); Alexander (1977), the L-stable diagonally
    implicit method of order 3. Charts by tangent space: Potra & Rheinboldt (1991).
"""

from __future__ import annotations

import contextlib
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..compiled import Control, Tableau, Taken
from ..errors import AssemblyError
from ..manifold.manifold import Posture
from ..manifold.module_chart import HELD, AmbiguousBranchError
from ..spatial import Array
from .motion_law import StepError
from .system import Coordinates, State, Stepped, System, in_quickest_chart, weighted

#: Diagonal of Alexander's L-stable SDIRK of order 3: the root of x^3 - 3 x^2 + 3/2 x - 1/6 near 0.44.
GAMMA = 0.435866521508458999416019451194
#: Tolerance of the implicit method's stages, relative to the solution's scale.
STAGE_TOLERANCE = 1e-12
#: Maximum number of iterations of a stage with one Jacobian; if more are needed, the step is too long.
STAGE_ITERATIONS = 25
#: Step of the one-sided differences of the Jacobian, in scaled coordinates.
JACOBIAN_DIFFERENCE = 1e-7
#: The same where closures lose rank, since positions are less accurate there.
WIDE_JACOBIAN_DIFFERENCE = 1e-5


@dataclass(frozen=True, eq=False)
class Explicit:
    """An explicit Runge-Kutta method.

    Attributes:
        A: Stage weights, shape (stages, stages).
        b: Weights of the result.
        e: Weights of the error estimate over the stages and one more at the result, or None.
    """

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
        if law.steps is None or law.in_c is None:
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


RK4 = Explicit(_rows([], [1 / 2], [0, 1 / 2], [0, 0, 1]), np.array([1 / 6, 1 / 3, 1 / 3, 1 / 6]), None)
DOPRI5 = Explicit(
    _rows(
        [], [1 / 5], [3 / 40, 9 / 40], [44 / 45, -56 / 15, 32 / 9],
        [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729],
        [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656],
    ),
    np.array([35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84]),
    np.array([71 / 57600, 0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40]),
)  # fmt: skip


class Implicit:
    """Alexander's diagonally implicit Runge-Kutta method of order 3, L-stable and stiffly accurate.

    Each step computes one Jacobian by differences, with all columns in one batch of the direct model.
    """

    A = np.array(
        [
            [GAMMA, 0.0, 0.0],
            [(1 - GAMMA) / 2, GAMMA, 0.0],
            [-(6 * GAMMA**2 - 16 * GAMMA + 1) / 4, (6 * GAMMA**2 - 20 * GAMMA + 5) / 4, GAMMA],
        ]
    )
    #: Result less that of order 2 on the first two stages.
    e = A[2] - np.array([1 - (1 - 2 * GAMMA) / (1 - GAMMA), (1 - 2 * GAMMA) / (1 - GAMMA), 0.0])

    def step(self, system: System, state: State, h: float) -> Stepped:
        """Advance a state by h [s].

        Raises:
            AssemblyError: A stage is out of reach.
            AmbiguousBranchError: A stage falls where closures lose rank.
            StepError: A stage did not converge.
        """
        return in_quickest_chart(system, state, lambda chart: self._step(system, state, h, chart))

    def _step(self, system: System, state: State, h: float, chart: Coordinates) -> Stepped:
        """Advance a state by h [s] in a chart, as `step`."""
        N = chart.size
        z0 = np.concatenate([np.zeros(N), chart.independent(state.v)])
        first = np.concatenate([z0[N:], chart.independent(state.a)])
        W = np.eye(2 * N) - h * GAMMA * self._jacobian(system, chart, state, z0, first)
        k: list[Array] = []
        spent = 0
        a = state.a
        end = Posture(state.q, np.zeros_like(state.v), state.v)
        guess = first
        for row in self.A:
            t = state.t + h * float(row.sum())
            known = z0 + h * weighted(row[: len(k)], k)
            try:
                guess, end, a, more = self._stage(system, chart, t, known, guess, h, W)
            except (AssemblyError, StepError) as failure:
                if chart.pivot > HELD:
                    raise
                # There the Jacobian is accurate for short steps only.
                raise AmbiguousBranchError(str(failure)) from None
            k.append(guess)
            spent += more
        # The error is filtered, so that stiff parts do not count.
        error = np.asarray(np.linalg.solve(W, h * weighted(self.e, k)), dtype=float)
        return Stepped(State(state.t + h, end.q, end.v, a), chart.rates(error[:N]), chart.rates(error[N:]),
                       spent, chart.pivot)  # fmt: skip

    def _stage(
        self, system: System, chart: Coordinates, t: float, known: Array, guess: Array, h: float, W: Array
    ) -> tuple[Array, Posture, Array, int]:
        """Solve k = f(known + h gamma k) by simplified Newton."""
        N, k, before = chart.size, guess, np.inf
        for spent in range(1, STAGE_ITERATIONS + 1):
            z = known + h * GAMMA * k
            p = system.posture(chart, t, z[:N], z[N:])
            y_dot, u_dot, a = system.rates(chart, np.array([t]), [p])
            f = np.concatenate([y_dot[0], u_dot[0]])
            dk = np.linalg.solve(W, f - k)
            change = float(np.abs(h * dk).max(initial=0.0))
            small = STAGE_TOLERANCE * (1.0 + float(np.abs(z).max(initial=0.0)))
            if change <= small or (change >= before and change <= 1e3 * small):
                return f, p, a[0], spent
            if not np.isfinite(change):
                break
            k, before = k + dk, change
        if chart.narrow:
            raise AmbiguousBranchError(
                f"the implicit stage at t = {t:g} s falls where closures lose rank, and rounding there keeps "
                "it from converging"
            )
        raise StepError(
            f"the implicit stage at t = {t:g} s did not converge in {STAGE_ITERATIONS} iterations "
            f"(last change {change:.2g}); take a shorter step"
        )

    def _jacobian(self, system: System, chart: Coordinates, state: State, z0: Array, f0: Array) -> Array:
        """Compute d(y_dot, u_dot)/d(y, u) at the start of the step, shape (2 N, 2 N)."""
        N = chart.size
        step = JACOBIAN_DIFFERENCE if chart.pivot > HELD else WIDE_JACOBIAN_DIFFERENCE
        size = step * np.maximum(1.0, np.abs(z0))
        postures = []
        for i in range(2 * N):
            z = z0.copy()
            z[i] += size[i]
            postures.append(system.posture(chart, state.t, z[:N], z[N:], state))
        if not postures:
            return np.zeros((0, 0))
        y_dot, u_dot, _ = system.rates(chart, np.full(2 * N, state.t), postures)
        return (np.concatenate([y_dot, u_dot], axis=1) - f0).T / size
