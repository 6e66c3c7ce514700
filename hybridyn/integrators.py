"""Methods that advance a state by one step on the constraint manifold.

Inside a step the unknowns are the independent coordinates y and velocities u of one chart (`chart.py`),
laid at the step's start:

    y_dot = L T(xi)^-1 v(y, u),    u_dot = L a(t, q, v),    L = the chart's `independent`

Every stage is lifted to an assembled posture before the direct model sees it. Errors are measured on q and v.
Near postures of lost rank a stage must move as the step's start foretells; else it is on another branch.

Source:
    Butcher tableaus: the classical method; Dormand & Prince (1980); Alexander (1977) for the L-stable SDIRK
        of
    order 3. Charts by tangent space: Potra & Rheinboldt (1991).
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from .chart import HELD, AmbiguousBranchError, Chart, Posture
from .errors import AssemblyError, HybridynError
from .manifold import Manifold
from .motion_law import MotionLaw
from .spatial import Array

if TYPE_CHECKING:
    from .compiled.steps import JointChart

#: Diagonal of Alexander's L-stable SDIRK of order 3: the root of x^3 - 3 x^2 + 3/2 x - 1/6 near 0.44.
GAMMA = 0.435866521508458999416019451194
#: Part of the solution's scale to which the stages of the implicit method are solved.
STAGE_TOLERANCE = 1e-12
#: Most iterations of a stage with one Jacobian; slower means the step is too long for it.
STAGE_ITERATIONS = 25
#: Step of the one-sided differences of the Jacobian, in scaled coordinates.
DIFFERENCE = 1e-7
#: The same where closures lose rank: positions there are known to less.
WIDE_DIFFERENCE = 1e-5
#: Part of the speed by which rates may differ from those foretold where another branch is near.
TURN = 0.3


class StepError(HybridynError):
    """A step could not be solved; a shorter one may."""


@dataclass(frozen=True)
class State:
    """A robot at one moment.

    Attributes:
        t: Time [s].
        q: Positions, shape (nq,), assembled.
        v: Rates, shape (nv,).
        a: Accelerations, shape (nv,).
    """

    t: float
    q: Array
    v: Array
    a: Array


@dataclass(frozen=True)
class Stepped:
    """What one step gave.

    Attributes:
        state: The new state.
        error_q: Estimate of the error of positions as a displacement, shape (nv,), or None.
        error_v: Estimate of the error of rates, shape (nv,), or None.
        iterations: Iterations of nonlinear solves.
        pivot: The chart's least pivot.
    """

    state: State
    error_q: Array | None
    error_v: Array | None
    iterations: int
    pivot: float


class Coordinates(Protocol):
    """Coordinates of the manifold about a posture: a `Chart`, or one of the compiled path."""

    @property
    def size(self) -> int:
        """Number of coordinates."""
        ...

    @property
    def narrow(self) -> bool:
        """True where another branch may be near the posture that `lift` gave last."""
        ...

    @property
    def pivot(self) -> float:
        """How far closures are from losing rank."""
        ...

    def independent(self, x: Array) -> Array:
        """Give the coordinates' share of rates, accelerations or displacements."""
        ...

    def lift(self, y: Array, u: Array, near: Array | None = None) -> Posture:
        """Give posture and rates at coordinates and velocities."""
        ...

    def rates(self, u: Array) -> Array:
        """Give the rates of u at the posture that `lift` gave last."""
        ...


@dataclass(frozen=True)
class System:
    """What is integrated.

    Attributes:
        manifold: The assembled postures.
        law: The accelerations.
        bound: False to let the closures drift inside a step (projected afterwards, or never).
        guarded: Whether they are bound all the same where closures are close to losing rank: there drift
            leads to another branch.
        baumgarte: Rate of Baumgarte's stabilisation [1/s], or None.
    """

    manifold: Manifold
    law: MotionLaw
    bound: bool = True
    guarded: bool = True
    baumgarte: float | None = None

    def acceleration(self, t: float, q: Array, v: Array) -> Array:
        """Give the accelerations at one state, shape (nv,)."""
        out: Array = self.accelerations(np.array([t]), q[None], v[None])[0]
        return out

    def accelerations(self, t: Array, q: Array, v: Array) -> Array:
        """Give the accelerations at many states, stabilised where that is asked for, shape (T, nv)."""
        a = self.law.accelerations(t, q, v)
        if self.baumgarte is not None:
            a += np.array([self.manifold.pull_back(*s, self.baumgarte) for s in zip(q, v, strict=True)])
        return a

    def chart(self, state: State) -> Chart:
        """Lay the chart of a step."""
        chart = self.manifold.chart(state.q, state.v, bound=self.bound or self.guarded)
        if self.bound or (self.guarded and chart.close_to_lost_rank):
            return chart
        return self.manifold.chart(state.q, bound=False)

    def joint_chart(self, state: State) -> JointChart | None:
        """Give the compiled path's chart for a step, None where there is none."""
        steps = self.law.steps
        return None if steps is None or not self.bound else steps.chart(state.q)

    def posture(
        self, chart: Coordinates, t: float, y: Array, u: Array, start: State | None = None
    ) -> Posture:
        """Give a chart's posture with a prescribed base in its place.

        Args:
            chart: The chart.
            t: Time [s].
            y: Coordinates, shape (N,).
            u: Velocities, shape (N,).
            start: The state at the chart's origin, which foretells the posture.

        Raises:
            AssemblyError: The loops do not close there.
            AmbiguousBranchError: Another branch is too near, or reached.
        """
        if start is None:
            p = chart.lift(y, u)
        else:
            h = t - start.t
            p = chart.lift(y, u, h * start.v + h * h / 2 * start.a)
            if chart.narrow:
                self._refuse_turns(p.v, start.v + h * start.a, t)
        self.law.place_base(t, p.q, p.v)
        return p

    def _refuse_turns(self, v: Array, foretold: Array, t: float) -> None:
        """Refuse rates that are not near those foretold.

        Raises:
            AmbiguousBranchError: They are not.
        """
        unit = self.manifold.unit
        off, size = (float(np.abs(x / unit).max(initial=0.0)) for x in (v - foretold, foretold))
        if off > TURN * size:
            raise AmbiguousBranchError(
                f"at t = {t:g} s, next to postures where closures lose rank, the motion turns away from "
                "where it was heading: that is another branch, or the step is too long"
            )

    def rates(self, chart: Coordinates, t: Array, postures: list[Posture]) -> tuple[Array, Array, Array]:
        """Give y_dot, u_dot and the accelerations of postures, shapes (T, N), (T, N), (T, nv)."""
        a = self.accelerations(t, np.array([p.q for p in postures]), np.array([p.v for p in postures]))
        pull = self.manifold.retraction.pull
        y_dot = np.array([chart.independent(pull(p.xi, p.v)) for p in postures])
        return y_dot, chart.independent(a.T).T, a


@dataclass(frozen=True)
class Explicit:
    """An explicit Runge-Kutta method.

    Attributes:
        order: Its order.
        A: Stage weights, shape (stages, stages).
        b: Weights of the result.
        e: Weights of the error estimate over the stages and one more at the result, or None.
    """

    order: int
    A: Array
    b: Array
    e: Array | None

    def steps(self, system: System, state: State, h: float, count: int) -> list[Stepped]:
        """Advance by h as often as the compiled path can be trusted to, `count` times at most.

        Its charts are those of joints that are independent everywhere else (`compiled.lift_program`), not of
        the tangent space at each step's start: results agree to the method's error.
        """
        law = system.law
        tau = law.constant_effort
        if law.steps is None or tau is None or not system.bound:
            return []
        taken = law.steps.take((self.A, self.b, self.e), (state.q, state.v, state.a), tau, h, count)
        law.evaluations += len(self.b) * len(taken.q)
        return [
            Stepped(State(state.t + (k + 1) * h, q, v, a), taken.error_q, taken.error_v, 0, float(pivot))
            for k, (q, v, a, pivot) in enumerate(zip(taken.q, taken.v, taken.a, taken.pivot, strict=True))
        ]

    def step(self, system: System, state: State, h: float) -> Stepped:
        """Advance by h, on the compiled path as far as it can be trusted.

        Raises:
            AssemblyError: A stage is out of reach.
        """
        if taken := self.steps(system, state, h, 1):
            return taken[0]
        return _in_quickest_chart(system, state, lambda chart: self._step(system, state, h, chart))

    def _step(self, system: System, state: State, h: float, chart: Coordinates) -> Stepped:
        """Advance by h in a chart.

        Raises:
            AssemblyError: A stage is out of reach.
        """
        u0 = chart.independent(state.v)
        ky, ku = [u0], [chart.independent(state.a)]
        for row in self.A[1:]:
            y, u = (h * _sum(row, k) for k in (ky, ku))
            t = state.t + h * float(row.sum())
            y_dot, u_dot, _ = system.rates(chart, np.array([t]), [system.posture(chart, t, y, u0 + u, state)])
            ky.append(y_dot[0])
            ku.append(u_dot[0])
        t = state.t + h
        end = system.posture(chart, t, h * _sum(self.b, ky), u0 + h * _sum(self.b, ku), state)
        y_dot, u_dot, a = system.rates(chart, np.array([t]), [end])
        error_q = error_v = None
        if self.e is not None:
            error_q = chart.rates(h * _sum(self.e, [*ky, y_dot[0]]))
            error_v = chart.rates(h * _sum(self.e, [*ku, u_dot[0]]))
        return Stepped(State(t, end.q, end.v, a[0]), error_q, error_v, 0, chart.pivot)


class Implicit:
    """Alexander's diagonally implicit Runge-Kutta method of order 3, L-stable and stiffly accurate.

    One Jacobian per step, by differences: all its columns in one batch of the direct model.
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
        """Advance by h.

        Raises:
            AssemblyError: A stage is out of reach.
            AmbiguousBranchError: A stage falls where closures lose rank.
            StepError: A stage did not converge.
        """
        return _in_quickest_chart(system, state, lambda chart: self._step(system, state, h, chart))

    def _step(self, system: System, state: State, h: float, chart: Coordinates) -> Stepped:
        """Advance by h in a chart, as `step`."""
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
            known = z0 + h * _sum(row[: len(k)], k)
            try:
                guess, end, a, more = self._stage(system, chart, t, known, guess, h, W)
            except (AssemblyError, StepError) as failure:
                if chart.pivot > HELD:
                    raise
                # The Jacobian there is good for short steps only.
                raise AmbiguousBranchError(str(failure)) from None
            k.append(guess)
            spent += more
        error = np.asarray(
            np.linalg.solve(W, h * _sum(self.e, k)), dtype=float
        )  # filtered, so that stiff parts do not count
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
        """Give d(y_dot, u_dot)/d(y, u) at the start of the step, shape (2 N, 2 N)."""
        N = chart.size
        size = (DIFFERENCE if chart.pivot > HELD else WIDE_DIFFERENCE) * np.maximum(1.0, np.abs(z0))
        postures = []
        for i in range(2 * N):
            z = z0.copy()
            z[i] += size[i]
            postures.append(system.posture(chart, state.t, z[:N], z[N:], state))
        if not postures:
            return np.zeros((0, 0))
        y_dot, u_dot, _ = system.rates(chart, np.full(2 * N, state.t), postures)
        return (np.concatenate([y_dot, u_dot], axis=1) - f0).T / size


def _in_quickest_chart(system: System, state: State, step: Callable[[Coordinates], Stepped]) -> Stepped:
    """Take a step in the compiled path's chart where that can be trusted, else in the tangent space's.

    Raises:
        AssemblyError, StepError: What `step` raises in the latter.
    """
    if (chart := system.joint_chart(state)) is not None:
        with contextlib.suppress(AmbiguousBranchError):
            return step(chart)
    return step(system.chart(state))


def _sum(weights: Array, k: list[Array]) -> Array:
    """Give the weighted sum of stages, zero weights left out."""
    out = np.zeros_like(k[0]) if k else np.zeros(())
    for w, x in zip(weights, k, strict=False):
        if w:
            out = out + w * x
    return out


def _rows(*rows: list[float]) -> Array:
    """Give a square lower triangular array from ragged rows."""
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
