"""Joints that stick and slide in a run: when each changes between both, and the state after that.

Between changes every joint slides in one direction or sticks, so that the motion is smooth and methods keep
their order. A joint that slides comes to rest where its rate passes zero; one that sticks is released where
the load exceeds what it holds (`dynamics.holding`). Both are located on the dense output, and the step is
taken again up to there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ..dynamics.stiction import carried, directions_from_rest, friction_of, stop_motion
from ..spatial import Array, Mask
from .events import PARTS, StepInterpolation
from .motion_law import StepError
from .stepping import Leap, Stepper
from .system import State, System

#: Part of what joints hold, at and above which they are released without a look at when it was reached.
OVER = 1.0 + 1e-12
#: Part of a step after which joints that could not begin to move at once are judged again.
SOON = 2.0**-20
#: Rate of a joint, over the largest, that counts as rest where others are stopped.
STANDING = 1e-11
#: Cosine between rate and direction of a ball below which it takes that of its rate, where joints change.
TURNED = 0.5
#: What a parabola over a step may miss of the held part, before the step is shortened to its first quarter.
ROUGH = 0.1
#: Changes at one time after which a run ends.
MOST_CHANGES = 1000
#: Distance of a joint that sticks from where it stuck that is rounding [rad or module lengths].
DRIFT = 8 * np.finfo(float).eps
#: Newton steps that move joints back to where they stuck.
BACK = 3


class UpToChange(NamedTuple):
    """One step up to the first change in it.

    Attributes:
        before: Its start, at which joints that could not begin to move stick again.
        leap: The step.
        changed: Whether joints change at its end.
    """

    before: State
    leap: Leap
    changed: bool


class Sticking:
    """The changes between sticking and sliding of a run."""

    def __init__(self, system: System) -> None:
        assert system.law.sticking is not None
        self._system, self._law, self._dry = system, system.law, system.law.sticking
        self._columns = self._dry.columns
        self._unit = system.manifold.unit[self._columns]
        self._last, self._same, self._fastest = np.nan, 0, 0.0

    def begin(self, state: State) -> State:
        """Return the start of a run with the directions of its joints."""
        return self._settled(state, self._moving(state.v, self._size(state.v)))

    def resume(self, state: State) -> State:
        """Return the start of a run that goes on, at which joints slide their way and hold their load.

        They need not where an event ended the earlier run, or where another load acts now.
        """
        against = self._dry.along(state.v[self._columns], state.signs) < 0
        if against.any() or self._ratio(state.t, state.q, state.v, state.signs) > OVER:
            return self._settled(state, np.where(against, 0.0, state.signs))
        return state

    def take(self, stepper: Stepper, before: State) -> UpToChange:
        """Take one step, up to the first change in it.

        Raises:
            AssemblyError: The loops cannot be closed, however short the step.
            StepError: A step's equations cannot be solved.
        """
        while True:
            self._law.signs = before.signs
            leap = stepper.advance(before, 1)
            between = StepInterpolation(self._system, before, leap.state(0), exact=True)
            times = before.t + (leap.t[0] - before.t) * np.arange(PARTS + 1) / PARTS
            rates = np.zeros((len(times), len(before.signs)))
            if before.signs.any():
                rates = np.array([between.at(t)[1][self._columns] for t in times])
                rates = self._dry.along(rates, before.signs)
            back = (rates[0] == 0) & (rates[1] < 0) & (rates[-1] <= 0)
            if not back.any():
                return self._up_to_change(stepper, before, leap, between, times, rates)
            stuck = replace(before, signs=np.where(back, 0.0, before.signs))
            before = self._with_accelerations(stuck)

    def after(self, taken: UpToChange, reached: State) -> State:
        """Return the state from which the next step starts.

        Raises:
            StepError: Joints change without end.
        """
        signs, v = taken.before.signs, reached.v[self._columns]
        self._fastest = max(self._fastest, self._size(reached.v))
        if not taken.changed:
            return replace(reached, signs=self._dry.directions(v, signs))
        self._same = self._same + 1 if reached.t == self._last else 0
        self._last = reached.t
        if self._same > MOST_CHANGES:
            raise StepError(
                f"at t = {reached.t:g} s joints change between sticking and sliding {MOST_CHANGES} times; "
                "leave stiction out"
            )
        way = self._dry.along(v, signs)
        slides, now = way > 0, self._dry.directions(v, signs)
        for at in self._dry.vectors:
            size, across = np.linalg.norm(v[at]), np.linalg.norm(v[at] - v[at] @ signs[at] * signs[at])
            moves = signs[at].any() and across > STANDING * self._fastest * self._unit[at[0]]
            # Else it would be braked across its rate, again and again.
            if moves and way[at[0]] <= TURNED * size:
                slides[at], now[at] = True, v[at] / size
        return self._settled(reached, np.where(slides, now, 0.0))

    def between(self, before: State, t: float, q: Array, v: Array) -> tuple[Array, Array]:
        """Return what an interpolation of a step says, with sticking joints where they stuck."""
        state = self._still(before, replace(before, t=t, q=q, v=v))
        return state.q, state.v

    def _up_to_change(
        self,
        stepper: Stepper,
        before: State,
        leap: Leap,
        between: StepInterpolation,
        times: Array,
        rates: Array,
    ) -> UpToChange:
        """Find the first change in a step, and take the step up to there."""
        end = float(leap.t[0])
        stop = self._first_stop(before, between, times, rates)
        changed = stop is not None
        if self._dry.at_rest(before.signs).any():
            until = times if stop is None else before.t + (stop - before.t) * np.arange(PARTS + 1) / PARTS
            parts = np.array([self._ratio(t, *between.at(t), before.signs) for t in until.tolist()])
            release = self._first_release(before, between, until, parts)
            changed, stop = (True, release) if release is not None else (changed, stop)
            foretold = [[3 / 8, 3 / 4, -1 / 8], [-1 / 8, 3 / 4, 3 / 8]] @ parts[[0, 2, 4]]
            if not changed and not stepper.fixed and np.abs(foretold - parts[[1, 3]]).max() > ROUGH:
                stop = float(times[1])
                leap = replace(leap, next_step=np.array([stop - before.t]))
        at = leap.state(0)
        if stop is not None and stop != end:
            at = replace(stepper.method.step(self._system, before, stop - before.t).state, t=stop)
        at = self._still(before, replace(at, signs=before.signs))
        leap = replace(leap, t=np.array([at.t]), q=at.q[None], v=at.v[None], a=at.a[None])
        return UpToChange(before, leap, changed)

    def _first_stop(
        self, before: State, between: StepInterpolation, times: Array, rates: Array
    ) -> float | None:
        """Return when the first joint comes to rest, from its rates along its directions, (PARTS + 1, k)."""
        for k, (x0, x1) in enumerate(pairwise(rates)):
            stops = (x0 > 0) & (x1 <= 0)
            if stops.any():

                def left(t: float, stops: Mask = stops) -> float:
                    rates = self._dry.along(between.at(t)[1][self._columns], before.signs)
                    return -float(rates[stops].min())

                return _passed(left, *times[k : k + 2])
        return None

    def _first_release(
        self, before: State, between: StepInterpolation, times: Array, parts: Array
    ) -> float | None:
        """Return when the load first exceeds what sticking joints hold: soon if it does at the start."""
        if parts[0] > OVER:  # they could not begin to move there
            return float(times[0] + SOON * (times[-1] - times[0]))
        for k, (x0, x1) in enumerate(pairwise(parts)):
            if x0 <= OVER < x1:
                edge = 1.0 if x0 <= 1 else OVER
                return _passed(
                    lambda t: self._ratio(t, *between.at(t), before.signs) - edge,  # noqa: B023
                    *times[k : k + 2],
                )
        return None

    def _ratio(self, t: float, q: Array, v: Array, signs: Array) -> float:
        """Return the largest part that sticking joints need at a state of what they can hold."""
        if not self._dry.at_rest(signs).any():
            return 0.0
        held = friction_of(self._law.free(t, q, v), signs, held=True).held
        return 0.0 if held is None else held.ratio

    def _moving(self, v: Array, size: float) -> Array:
        """Return directions of joints, 0 of those at rest, from rates and the largest of them per unit."""
        rates = v[self._columns]
        sizes = np.abs(rates)
        for at in self._dry.vectors:
            sizes[at] = np.linalg.norm(rates[at])
        return np.where(sizes > STANDING * size * self._unit, rates / np.where(sizes > 0, sizes, 1.0), 0.0)

    def _size(self, v: Array) -> float:
        """Return the largest rate per unit."""
        return float(np.abs(v / self._system.manifold.unit).max(initial=0.0))

    def _settled(self, state: State, signs: Array) -> State:
        """Return a state at which joints without a direction stick, or begin to move."""
        t, q, v = state.t, state.q, state.v.copy()
        size, rest = self._size(v), self._dry.at_rest(signs)
        if rest.any():
            v = stop_motion(self._law.free(t, q, v), v, np.flatnonzero(rest))
        rest = rest | self._dry.at_rest(self._moving(v, size))
        v[self._columns[rest]] = 0.0
        free = self._law.free(t, q, v)
        signs = directions_from_rest(free, np.where(rest, 0.0, signs))
        return State(t, q, v, free.accelerations(friction_of(free, signs).efforts), signs)

    def _with_accelerations(self, state: State) -> State:
        """Return a state with the accelerations of its directions."""
        free = self._law.free(state.t, state.q, state.v)
        return replace(state, a=free.accelerations(friction_of(free, state.signs).efforts))

    def _still(self, before: State, state: State) -> State:
        """Return a state with sticking joints where they stuck, and without their rates.

        A method holds them to its error where a loop moves on and some of its joints stick, else to rounding.
        """
        stuck = np.flatnonzero(self._dry.at_rest(state.signs))
        columns, manifold, stays = self._columns[stuck], self._system.manifold, self._dry.stays(state.signs)
        unit, q, v = self._unit[stuck], state.q, state.v.copy()
        for _ in range(BACK):
            away = np.where(stays[stuck], manifold.retraction.difference(before.q, q)[columns], 0.0)
            quick = STANDING * self._size(v) * unit
            if not ((np.abs(away) > DRIFT * unit) | (np.abs(v[columns]) > quick)).any():
                break
            free = self._law.free(state.t, q, v)
            q = manifold.retraction.move(q, -carried(free, stuck, away))
            v = stop_motion(free, v, stuck)
            if manifold.looped:
                q, v = manifold.project(q, v)
        else:
            state = self._with_accelerations(replace(state, q=q, v=v))
        v[columns] = 0.0
        return replace(state, q=q, v=v)


def _passed(function: Callable[[float], float], t0: float, t1: float) -> float:
    """Return a time, to rounding, at which a function that rises through zero between two is positive."""
    from scipy.optimize import brentq  # SciPy is slow to load

    t = float(brentq(function, t0, t1, xtol=np.spacing(max(abs(t0), abs(t1))), rtol=4 * np.finfo(float).eps))
    onwards = np.spacing(t)
    while t < t1 and function(t) <= 0:
        t, onwards = t + onwards, 2 * onwards
    return min(t, float(t1))
