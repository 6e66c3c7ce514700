"""Step control: fixed steps on a grid, adaptive steps by the error estimate, and retries of failed steps."""

from __future__ import annotations

from dataclasses import replace
from typing import Protocol

import numpy as np

from ..errors import AssemblyError
from ..manifold.chart import AmbiguousBranchError
from .conserving import Conserving
from .explicit import DOPRI5, RK4, Explicit
from .implicit import Implicit
from .result import Counters
from .solver import Solver
from .system import State, StepError, Stepped, System

#: Relative residual of closures and their rates above which a step's result is projected.
DRIFT = 1e-11
#: Shortest step, relative to the largest time of the run.
SHORTEST = 1e-13
#: Distance to the end of the run, in steps, below which a grid point counts as the end.
SAME_POINT = 1e-9
#: First part of a fixed step that is split in two since it comes too near to another branch.
PART = 0.38
#: Maximum depth of such splits.
SPLITS = 8
#: Maximum number of fixed steps that the compiled path takes in one call.
AHEAD = 64


class Method(Protocol):
    """A method that advances a state by one step."""

    def step(self, system: System, state: State, h: float) -> Stepped:
        """Advance by h."""
        ...


def build_method(method: str, system: System) -> Explicit | Implicit | Conserving:
    """Build the method of a name."""
    if method == "conserving":
        return Conserving(system.law)
    if method == "implicit":
        return Implicit()
    return RK4 if method == "rk4" else DOPRI5


class Stepper:
    """Takes the steps of a run from its start to its end.

    Attributes:
        counters: Counters of the steps' work.
        next_step: Length of the next step, signed [s].
        on_grid: Fixed steps taken since `start`.
        start: Start of the grid of fixed steps [s].
        method: The method.
    """

    def __init__(self, system: System, method: Method, solver: Solver, end: float, begin: State) -> None:
        self._system, self.method, self._solver = system, method, solver
        self._end = end
        self.sign = 1.0 if end >= begin.t else -1.0
        self.counters = Counters()
        self.on_grid, self.start = 0, begin.t
        self.next_step = self.sign * (solver.step or self._first(begin))
        self._ahead: list[Stepped] = []
        self._reached: State | None = None

    def resume(self, next_step: float, on_grid: int, start: float) -> None:
        """Continue with the next step and the grid of an earlier run."""
        self.next_step = next_step
        if self._solver.fixed is None or abs(next_step) == self._solver.fixed:
            self.on_grid, self.start = on_grid, start

    def advance(self, state: State) -> Stepped:
        """Take one step: of fixed length, or one whose error is within the tolerances.

        Raises:
            AssemblyError: The loops cannot be closed, however short the step.
            StepError: A step's equations cannot be solved.
        """
        stepped = self._fixed(state) if self._solver.fixed else self._chosen(state)
        self.counters.steps += 1
        self.counters.iterations += stepped.iterations
        return self._projected(stepped) if self._solver.projection == "steps" else stepped

    def _fixed(self, state: State) -> Stepped:
        """Step to the next grid point, or to the end."""
        h = self.next_step
        if (
            state.t != self.start + self.on_grid * h
        ):  # a run that ended between grid points continues from there
            self.start, self.on_grid = state.t, 0
        target = self.start + (self.on_grid + 1) * h
        beyond = self.sign * (target - self._end)
        if beyond > -SAME_POINT * abs(h):
            target = self._end
        whole = abs(beyond) <= SAME_POINT * abs(h) or beyond < 0
        stepped = self._taken_ahead(state, h) if whole else None
        stepped = stepped or self._in_parts(state, h if whole else target - state.t, SPLITS)
        self.on_grid += 1
        at = stepped.state
        self._reached = State(target, at.q, at.v, at.a)
        return replace(stepped, state=self._reached)

    def _taken_ahead(self, state: State, h: float) -> Stepped | None:
        """Return the next step that the compiled path took in advance, or None where there is none."""
        if state is not self._reached:
            self._ahead = []
        if not self._ahead and isinstance(self.method, Explicit):
            left = int(abs(self._end - state.t) / abs(h) + SAME_POINT)
            self._ahead = self.method.steps(self._system, state, h, min(left, AHEAD))[::-1]
        return self._ahead.pop() if self._ahead else None

    def _in_parts(self, state: State, h: float, splits: int) -> Stepped:
        """Advance by h, in unequal parts where a stage comes too near to another branch.

        Raises:
            AmbiguousBranchError: The shortest parts come too near, too.
        """
        try:
            return self.method.step(self._system, state, h)
        except AmbiguousBranchError:
            if not splits:
                raise
        first = self._in_parts(state, PART * h, splits - 1)
        second = self._in_parts(first.state, state.t + h - first.state.t, splits - 1)
        self.counters.iterations += first.iterations
        return replace(second, error_q=None, error_v=None, pivot=min(first.pivot, second.pivot))

    def _chosen(self, state: State) -> Stepped:
        """Take an adaptive step, repeated with shorter lengths until its error is within the tolerances."""
        shortest = SHORTEST * max(abs(state.t), abs(self._end), abs(self._end - state.t))
        while True:
            left = self._end - state.t
            h = self.next_step
            last = abs(h) >= abs(left) * (1 - SAME_POINT)
            if last:
                h = left
            failure: AssemblyError | StepError | None = None
            try:
                stepped = self.method.step(self._system, state, h)
                error = self._error(state, stepped)
            except (AssemblyError, StepError) as caught:
                failure, error = caught, np.inf
            factor = (
                0.25
                if failure
                else float(np.clip(0.9 * max(error, 1e-10) ** (-1 / self._solver.error_order), 0.2, 5))
            )
            if error <= 1.0:
                if not (last and factor > 1 and abs(h) < abs(self.next_step)):
                    self.next_step = h * factor
                return replace(stepped, state=replace(stepped.state, t=self._end)) if last else stepped
            self.counters.rejected += 1
            self.next_step = h * min(factor, 0.9)
            if abs(self.next_step) < shortest:
                raise failure or StepError(
                    f"the error of a step at t = {state.t:g} s stays above the tolerance down to "
                    f"{abs(h):.1g} s; the motion is not smooth there, or stiff: try method='implicit'"
                )

    def _error(self, state: State, stepped: Stepped) -> float:
        """Compute the largest error relative to its tolerance."""
        if stepped.error_q is None or stepped.error_v is None:
            return 0.0
        unit = self._system.manifold.unit
        speed = max(float(np.abs(x / unit).max(initial=0.0)) for x in (state.v, stepped.state.v))
        of_q = np.abs(stepped.error_q / unit).max(initial=0.0) / (self._solver.atol + self._solver.rtol)
        of_v = np.abs(stepped.error_v / unit).max(initial=0.0) / (
            self._solver.atol + self._solver.rtol * speed
        )
        worst = float(max(of_q, of_v))
        return worst if np.isfinite(worst) else np.inf

    def _projected(self, stepped: Stepped) -> Stepped:
        """Project position and velocity on the closures where they deviate by more than `DRIFT`."""
        manifold, state = self._system.manifold, stepped.state
        if manifold.residual(state.q) <= DRIFT and manifold.opening(state.q, state.v)[0] <= DRIFT:
            return stepped
        self.counters.projections += 1
        q, v = manifold.project(state.q, state.v)
        return replace(stepped, state=State(state.t, q, v, self._system.acceleration(state.t, q, v)))

    def _first(self, state: State) -> float:
        """Estimate the length of the first step from rates and accelerations."""
        unit = self._system.manifold.unit
        v, a = (float(np.abs(x / unit).max(initial=0.0)) for x in (state.v, state.a))
        span = abs(self._end - state.t)
        return 0.01 * min(10 * span, 1 / v if v > 0 else span * 10, 1 / np.sqrt(a) if a > 0 else span * 10)
