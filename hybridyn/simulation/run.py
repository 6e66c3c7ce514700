"""One run of a simulation: the loop over steps, with its events and outputs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from os import PathLike
from typing import TYPE_CHECKING

import numpy as np

from ..dynamics.energy import Energy, energy
from ..errors import AssemblyError, SingularityError
from ..spatial import Array
from .conserving import Conserving
from .events import Event, Found, StepInterpolation, occurrences
from .motion_law import StepError
from .result import Counters, Origin, SimulationResult, joined
from .stepping import Leap, Stepper
from .system import State, System

if TYPE_CHECKING:
    from .sticking import Sticking

#: Number of steps between two checkpoints.
CHECKPOINT_STEPS = 1000
#: Number of output samples that are evaluated in one batch of the direct model. An interrupt waits for it.
BLOCK = 128

Progress = Callable[[float, float], None]


class Run:
    """One run: the loop over steps, and the samples, events and counters collected so far."""

    def __init__(
        self, system: System, stepper: Stepper, origin: Origin, events: tuple[Event, ...],
        wanted: Array | None, state: State, earlier: SimulationResult | None, sticking: Sticking | None,
    ) -> None:  # fmt: skip
        self._system, self._stepper, self._origin = system, stepper, origin
        self._events, self._wanted, self._state = events, wanted, state
        self._done = earlier
        self._sticking = sticking
        self._samples: list[tuple[float, Array, Array, Array]] = []
        self._latest = np.nan if earlier is None or not len(earlier.t) else float(earlier.t[-1])
        self._parts: list[dict[str, Array]] = []
        self._progress: Progress | None = None
        self._found: list[Found] = []
        self._pivots: list[float] = []
        self._next = 0
        if wanted is not None:
            ahead = stepper.sign * (wanted - state.t)
            self._next = int(np.searchsorted(ahead, 0.0, side="left" if earlier is None else "right"))
        if earlier is None and (
            wanted is None or (self._next < len(wanted) and wanted[self._next] == state.t)
        ):
            self._add(state.t, state.q, state.v, state.signs)
            self._next += 1
        self._values = [e.function(state.t, state.q, state.v) for e in events]

    def to(
        self, end: float, progress: Progress | None, checkpoint: str | PathLike[str] | None
    ) -> SimulationResult:
        """Run to the end, or until an event, a failure or an interrupt stops the run."""
        status, message = "finished", ""
        self._progress, self._end = progress, end
        most = CHECKPOINT_STEPS
        try:
            while self._stepper.sign * (end - self._state.t) > 0:
                if checkpoint is not None:
                    most = CHECKPOINT_STEPS - self._stepper.counters.steps % CHECKPOINT_STEPS
                if self._step(most):
                    status, message = "event", f"'{self._found[-1].name}' at t = {self._found[-1].t:g} s"
                    break
                if checkpoint is not None and self._stepper.counters.steps % CHECKPOINT_STEPS == 0:
                    self.result("interrupted", f"checkpoint at t = {self._state.t:g} s").save(checkpoint)
        except KeyboardInterrupt:
            status, message = "interrupted", f"at t = {self._state.t:g} s"
        except AssemblyError as error:
            status, message = "unreachable", f"after t = {self._state.t:g} s: {error}"
        except StepError as error:
            status, message = "unsolved", str(error)
        except SingularityError as error:
            status, message = "singular", f"after t = {self._state.t:g} s: {error}"
        result = self.result(status, message)
        if checkpoint is not None:
            result.save(checkpoint)
        return result

    def _step(self, most: int) -> bool:
        """Take steps, up to `most`, with their events and outputs; return whether an event ends the run."""
        before, last, taken = self._state, None, None
        if self._sticking is not None:
            before, leap, _ = taken = self._sticking.take(self._stepper, before)
        else:
            leap = self._stepper.advance(before, 1 if self._events else most)
        values: list[float] = []
        if self._events:
            after = leap.state(0)
            values = [e.function(after.t, after.q, after.v) for e in self._events]
            found, last = self._events_in(self._between(before, after), before.t, values)
            if last is not None:
                a = self._system.law.acceleration(last.t, last.q, last.v)
                leap = replace(leap, t=np.array([last.t]), q=last.q[None], v=last.v[None], a=a[None])
        several = len(leap.t) > 1
        leap, interrupt = self._shown(leap) if several else (leap, None)
        self._add_outputs(before, leap)
        if last is not None and self._wanted is not None and self._latest != last.t:
            self._add(last.t, last.q, last.v, before.signs)
        if self._events:
            self._found += found
        self._pivots += leap.pivot.tolist()
        self._state, self._values = self._stepper.accept(leap), values
        if self._sticking is not None and taken is not None:
            ended = replace(self._state, signs=before.signs)
            self._state = now = ended if last is not None else self._sticking.after(taken, self._state)
            self._values = [e.function(now.t, now.q, now.v) for e in self._events]
        if interrupt is not None:
            raise interrupt
        if self._progress is not None and not several and last is None:
            self._progress(self._state.t, self._end)
        return last is not None

    def _between(self, before: State, after: State) -> StepInterpolation:
        """Return the interpolation of a step."""
        exact = not isinstance(self._stepper.method, Conserving)
        return StepInterpolation(self._system, before, after, exact=exact)

    def _shown(self, leap: Leap) -> tuple[Leap, BaseException | None]:
        """Show the progress after each step; return the steps up to an interrupt, and that."""
        if self._progress is not None:
            for k, t in enumerate(leap.t.tolist()):
                try:
                    self._progress(t, self._end)
                except BaseException as interrupt:  # what has been computed is kept first
                    return leap.part(0, k + 1), interrupt
        return leap, None

    def _add_outputs(self, before: State, leap: Leap) -> None:
        if self._wanted is None:
            for t, q, v in zip(leap.t.tolist(), leap.q, leap.v, strict=True):
                self._add(t, q, v, before.signs)
            return
        sign, at, between = self._stepper.sign, -1, None
        reached = sign * leap.t
        ahead = sign * self._wanted[self._next :]
        ahead = ahead[: np.searchsorted(ahead, reached[-1], side="right")]
        steps = np.searchsorted(reached, ahead).tolist()
        for t, k in zip((sign * ahead).tolist(), steps, strict=True):
            if t == leap.t[k]:
                self._add(t, leap.q[k], leap.v[k], before.signs)
            else:
                if k != at or between is None:
                    between = self._between(leap.state(k - 1) if k else before, leap.state(k))
                    at = k
                q, v = between.at(t)
                if self._sticking is not None:
                    q, v = self._sticking.between(before, t, q, v)
                self._add(t, q, v, before.signs)
            self._next += 1

    def _add(self, t: float, q: Array, v: Array, signs: Array) -> None:
        self._samples.append((t, q.copy(), v.copy(), signs))
        self._latest = t
        if len(self._samples) == BLOCK:
            self._complete_block()
            if self._progress is not None:  # many rows in one step: an interrupt does not wait for its end
                self._progress(self._state.t, self._end)

    def _events_in(
        self, between: StepInterpolation, t0: float, values: list[float]
    ) -> tuple[list[Found], Found | None]:
        """Return the events of a step in order, and the first that ends the run."""
        sign = self._stepper.sign
        found: list[tuple[Event, Found]] = []
        for event, x0, x1 in zip(self._events, self._values, values, strict=True):
            found += [(event, one) for one in occurrences(event, between, t0, x0, x1)]
        found.sort(key=lambda pair: sign * pair[1].t)
        last = next((f for e, f in found if e.terminal), None)
        kept = [f for _, f in found if last is None or sign * (last.t - f.t) >= 0]
        return kept, last

    def result(self, status: str, message: str) -> SimulationResult:
        """Build the result so far, and complete the samples added since the last call."""
        law, counters = self._system.law, self._stepper.counters
        counters.evaluations = law.evaluations
        new, stepper = self._complete(), self._stepper
        result = SimulationResult(
            origin=self._origin, **new, pivot=np.array(self._pivots),
            events=tuple(self._found), status=status, message=message, counters=replace(counters),
            state=self._state, next_step=stepper.next_step, on_grid=stepper.on_grid, start=stepper.start,
        )  # fmt: skip
        if self._done is not None:
            result = joined(self._done, result)
        self._done, self._found, self._pivots = result, [], []
        stepper.counters, law.evaluations = Counters(), 0
        return result

    def _complete(self) -> dict[str, Array]:
        """Compute times, q, v, a, efforts, energies and residuals of the new samples."""
        self._complete_block()
        out = {name: np.concatenate([part[name] for part in self._parts]) for name in self._parts[0]}
        self._parts = []
        # After an interrupt between the outputs of a step and its end, that step is repeated on resuming.
        late = self._stepper.sign * (out["t"] - self._state.t) > 0
        return {name: x[~late] for name, x in out.items()}

    def _complete_block(self) -> None:
        """Evaluate the direct model at the pending samples."""
        law = self._system.law
        robot, spent = law.robot, law.evaluations
        t, q, v, signs = (
            np.array([row[i] for row in self._samples]).reshape(len(self._samples), *shape)
            for i, shape in enumerate(((), (robot.nq,), (robot.nv,), self._state.signs.shape))
        )
        self._samples = []
        # One sample alone is evaluated twice: NumPy adds its terms in another order than those of several,
        # and a run that stopped and went on must have the bits of one run.
        twice = [np.repeat(x, 2, axis=0) if len(t) == 1 else x for x in (t, q, v, signs)]
        a, tau = np.zeros((0, robot.nv)), np.zeros((0, len(robot.motors)))
        if len(t):
            a, tau = (x[: len(t)] for x in law.driven(*twice))
        law.evaluations = spent
        residual = law.closure_residual(twice[1])[: len(t)] if len(t) else np.zeros(0)
        stored = energy(robot, q, v, effects=law.on) if len(t) else Energy(np.zeros(0), np.zeros(0))
        self._parts.append({
            "t": t, "q": q, "v": v, "a": a, "tau": tau, "kinetic": stored.kinetic,
            "potential": stored.potential, "residual": residual,
        })  # fmt: skip
