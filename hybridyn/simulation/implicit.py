"""An implicit method for stiff scenes, in the same charts as `explicit`.

Source:
    Alexander (1977): the L-stable diagonally implicit Runge-Kutta method of order 3.
"""

from __future__ import annotations

import numpy as np

from ..errors import AssemblyError
from ..manifold.manifold import Posture
from ..manifold.module_chart import HELD, AmbiguousBranchError
from ..spatial import Array
from .system import Coordinates, State, StepError, Stepped, System, in_quickest_chart, weighted

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


class Implicit:
    """Alexander's diagonally implicit Runge-Kutta method of order 3, L-stable and stiffly accurate.

    Each step computes one Jacobian by differences, with all columns in one batch of the direct model.
    """

    order = 3
    _late = (1 + GAMMA) / 2
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
