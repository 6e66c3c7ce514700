"""Steps of a run: fixed ones on a grid, adaptive ones by the error estimate, retries of failed ones."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from ..compiled import Control
from ..errors import AssemblyError
from ..manifold.module_chart import AmbiguousBranchError
from ..spatial import Array, Index
from .motion_law import StepError
from .result import Counters
from .runge_kutta import Explicit
from .solver import Method, Solver
from .system import State, Stepped, System

#: Shortest step, relative to the largest time of the run.
SHORTEST = 1e-13
#: Distance to the end of the run, in steps, below which a grid point counts as the end.
SAME_POINT = 1e-9
#: First part of a fixed step that is split in two since it comes too near to another branch.
PART = 0.38
#: Maximum depth of such splits.
SPLITS = 8
#: Maximum number of steps that the compiled path takes in one call, and where each calls a law in Python:
#: an interrupt waits for them.
AHEAD, AHEAD_CALLING = 256, 16


@dataclass(frozen=True, eq=False)
class Leap:
    """Steps that follow each other, taken together.

    Attributes:
        t: Times after each step, shape (steps,), [s].
        q, v, a: States after each step, shapes (steps, nq), (steps, nv), (steps, nv).
        pivot: The chart's least pivot in each step, shape (steps,).
        next_step: Length of the step that is to follow each one, shape (steps,), [s].
        rejected: How often each step was repeated with a shorter length, shape (steps,); 0 where that has
            been counted already.
        evaluations: Evaluations of the direct model in each step, shape (steps,); 0 where the law counted.
    """

    t: Array
    q: Array
    v: Array
    a: Array
    pivot: Array
    next_step: Array
    rejected: Index
    evaluations: Index

    def state(self, k: int) -> State:
        """Return the state after a step."""
        return State(float(self.t[k]), self.q[k], self.v[k], self.a[k])

    def part(self, start: int, stop: int) -> Leap:
        """Return some of the steps."""
        return Leap(*(getattr(self, field.name)[start:stop] for field in fields(self)))


class Stepper:
    """Takes the steps of a run from its start to its end.

    Attributes:
        counters: Counters of the steps' work.
        next_step: Length of the next step, signed [s].
        on_grid: Fixed steps taken since `start`.
        start: Start of the grid of fixed steps [s].
    """

    def __init__(self, system: System, method: Method, solver: Solver, end: float, begin: State) -> None:
        self._system, self.method, self._solver = system, method, solver
        self._end = end
        self.sign = 1.0 if end >= begin.t else -1.0
        self.counters = Counters()
        self.on_grid, self.start = 0, begin.t
        self.next_step = self.sign * (solver.step or self._first(begin))
        self._ahead: Leap | None = None
        self._reached: State | None = None
        self._refused: tuple[State, float] | None = None  # a step that the compiled path has just refused

    @property
    def fixed(self) -> bool:
        """Whether steps have a fixed length."""
        return self._solver.fixed is not None

    def resume(self, next_step: float, on_grid: int, start: float) -> None:
        """Continue with the next step and the grid of an earlier run."""
        self.next_step = next_step
        if self._solver.fixed is None or abs(next_step) == self._solver.fixed:
            self.on_grid, self.start = on_grid, start

    def advance(self, state: State, most: int) -> Leap:
        """Take steps: of fixed length, or such that their errors are within the tolerances.

        On the compiled path these are several steps, up to `most`; on the general path it is one.

        Raises:
            AssemblyError: The loops cannot be closed, however short the step.
            StepError: A step's equations cannot be solved.
        """
        if self._solver.fixed and state.t != self.start + self.on_grid * self.next_step:
            self.start, self.on_grid = state.t, 0  # a run that ended between grid points continues from there
        if self._ahead is None or state is not self._reached:
            self._ahead = self._in_c(state)
        if self._ahead is None:
            stepped = self._fixed(state) if self._solver.fixed else self._chosen(state)
            self.counters.iterations += stepped.iterations
            at = stepped.state
            self._ahead = Leap(
                np.array([at.t]), at.q[None], at.v[None], at.a[None], np.array([stepped.pivot]),
                np.array([self.next_step]), *np.zeros((2, 1), dtype=int),
            )  # fmt: skip
        return self._ahead.part(0, most)

    def accept(self, leap: Leap) -> State:
        """Count steps that `advance` took, or the first of them, as taken, and return the state reached."""
        count = len(leap.t)
        self.counters.steps += count
        self.counters.rejected += int(leap.rejected.sum())
        self._system.law.evaluations += int(leap.evaluations.sum())
        self.next_step = float(leap.next_step[-1])
        self.on_grid += count if self._solver.fixed else 0
        self._reached = leap.state(-1)
        assert self._ahead is not None
        self._ahead = self._ahead.part(count, len(self._ahead.t)) if count < len(self._ahead.t) else None
        return self._reached

    def _in_c(self, state: State) -> Leap | None:
        """Take steps in advance on the compiled path; return None where it cannot take any."""
        law = self._system.law
        if not isinstance(self.method, Explicit) or law.in_c is None:
            return None
        most, h, fixed = AHEAD_CALLING if law.in_c.calls else AHEAD, self.next_step, self._solver.fixed
        if fixed:
            most = min(most, int(abs(self._end - state.t) / abs(h) + SAME_POINT))
        if not most:
            return None
        times = np.asarray(self.start + (self.on_grid + np.arange(most + 1)) * h, dtype=float)
        times[0] = state.t
        taken = self.method.steps(self._system, state, times, h, None if fixed else self._control(state.t))
        if taken is None:
            return None
        if not len(taken.q):
            self._refused = None if taken.shortened else (state, h)
            return None
        t = taken.t[1:]
        if fixed:
            t[self.sign * (t - self._end) > -SAME_POINT * abs(h)] = self._end
        evaluations = len(self.method.b) * (1 + taken.rejected)
        return Leap(t, taken.q, taken.v, taken.a, taken.pivot, taken.next_step, taken.rejected, evaluations)

    def _control(self, t: float) -> Control:
        """Return how the estimated error chooses the lengths of steps in C from a time on."""
        solver, unit = self._solver, self._system.manifold.unit
        return Control(
            unit, end=self._end, rtol=solver.rtol, atol=solver.atol, power=-1 / solver.error_order,
            shortest=self._shortest(t), same_point=SAME_POINT,
        )  # fmt: skip

    def _fixed(self, state: State) -> Stepped:
        """Step to the next grid point, or to the end."""
        h = self.next_step
        target = self.start + (self.on_grid + 1) * h
        beyond = self.sign * (target - self._end)
        if beyond > -SAME_POINT * abs(h):
            target = self._end
        whole = abs(beyond) <= SAME_POINT * abs(h) or beyond < 0
        stepped = self._in_parts(state, h if whole else target - state.t, SPLITS)
        return replace(stepped, state=replace(stepped.state, t=target))

    def _in_parts(self, state: State, h: float, splits: int) -> Stepped:
        """Advance by h, in unequal parts where a stage comes too near to another branch.

        Raises:
            AmbiguousBranchError: The shortest parts come too near, too.
        """
        try:
            return self._one(state, h)
        except AmbiguousBranchError:
            if not splits:
                raise
        first = self._in_parts(state, PART * h, splits - 1)
        second = self._in_parts(first.state, state.t + h - first.state.t, splits - 1)
        self.counters.iterations += first.iterations
        return replace(second, error_q=None, error_v=None, pivot=min(first.pivot, second.pivot))

    def _one(self, state: State, h: float) -> Stepped:
        """Take one step; on the general path if the compiled path has just refused it.

        Raises:
            AssemblyError, StepError: Those of the method.
        """
        refused, self._refused = self._refused, None
        again = refused is not None and refused[0] is state and refused[1] == h
        if again and isinstance(self.method, Explicit):
            return self.method.general_step(self._system, state, h)
        return self.method.step(self._system, state, h)

    def _chosen(self, state: State) -> Stepped:
        """Take an adaptive step, repeated with shorter lengths until its error is within the tolerances."""
        shortest = self._shortest(state.t)
        while True:
            left = self._end - state.t
            h = self.next_step
            last = abs(h) >= abs(left) * (1 - SAME_POINT)
            if last:
                h = left
            failure: AssemblyError | StepError | None = None
            try:
                stepped = self._one(state, h)
                error = self._error(state, stepped)
                factor = float(np.clip(0.9 * max(error, 1e-10) ** (-1 / self._solver.error_order), 0.2, 5))
            except (AssemblyError, StepError) as caught:
                failure, error, factor = caught, np.inf, 0.25
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

    def _shortest(self, t: float) -> float:
        return SHORTEST * max(abs(t), abs(self._end), abs(self._end - t))

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

    def _first(self, state: State) -> float:
        """Estimate the length of the first step from rates and accelerations."""
        unit = self._system.manifold.unit
        v, a = (float(np.abs(x / unit).max(initial=0.0)) for x in (state.v, state.a))
        span = abs(self._end - state.t)
        return 0.01 * min(10 * span, 1 / v if v > 0 else span * 10, 1 / np.sqrt(a) if a > 0 else span * 10)
