"""States between the ends of steps, and the events there: zeros of functions of time and state.

Between the ends of a step, positions follow the quintic Hermite polynomial of the displacement xi, its rate
and its second rate at both ends; rates are its derivative. The result is projected on the closures, as every
other state.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from ..manifold.manifold import Manifold
from ..spatial import Array
from ..structure.robot import HybridRobot
from ..structure.samples import as_number, one_of
from .system import State, System

#: Bisections of one step: its length over 2^52 is rounding.
BISECTIONS = 52
#: Parts of a step at whose ends an event's function is evaluated; it may pass zero and return between them.
PARTS = 4
#: Relative step of the central difference that gives the rate of T^-1 (joints with rotations only).
RATE_DIFFERENCE = 1e-5

# Quintic Hermite basis over s in [0, 1], coefficients of s^0 .. s^5: value, rate, second rate at 0, then at
# 1.
QUINTIC = np.array(
    [
        [1, 0, 0, -10, 15, -6],
        [0, 1, 0, -6, 8, -3],
        [0, 0, 0.5, -1.5, 1.5, -0.5],
        [0, 0, 0, 10, -15, 6],
        [0, 0, 0, -4, 7, -3],
        [0, 0, 0, 0.5, -1, 0.5],
    ]
)


class StepInterpolation:
    """Interpolation of the states within one step.

    Attributes:
        end: End of the step [s].
    """

    def __init__(self, system: System, before: State, after: State, *, exact: bool) -> None:
        """Set the ends of the step.

        Args:
            before: Start of the step.
            after: End of the step.
            exact: True where both ends carry the direct model's accelerations.
        """
        self._system, self._before, self._after = system, before, after
        self._exact, self.end = exact, after.t

    @cached_property
    def _ends(self) -> Array:
        """Value, first and second rate of xi at both ends, times powers of h, shape (6, nv)."""
        retraction = self._system.manifold.retraction
        h = self._after.t - self._before.t
        a0, a1 = self._before.a, self._after.a
        if not self._exact:
            law, ends = self._system.law, (self._before, self._after)
            a0, a1 = (law.acceleration(end.t, end.q.copy(), end.v.copy()) for end in ends)
        moved = h * (self._before.v + self._after.v) / 2
        xi = retraction.unwound(retraction.difference(self._before.q, self._after.q), moved)
        rate = retraction.pull(xi, self._after.v)
        second0, second1 = a0, retraction.pull(xi, a1)
        if not retraction.flat:
            second0 = second0 + self._turning(np.zeros_like(xi), self._before.v, self._before.v)
            second1 = second1 + self._turning(xi, rate, self._after.v)
        return np.array([0 * xi, h * self._before.v, h * h * second0, xi, h * rate, h * h * second1])

    def _turning(self, xi: Array, rate: Array, v: Array) -> Array:
        """Compute d(T^-1)/dt v by a central difference, shape (nv,)."""
        manifold = self._system.manifold
        pull = manifold.retraction.pull
        size = RATE_DIFFERENCE / max(1.0, float(np.abs(rate / manifold.unit).max(initial=0.0)))
        return (pull(xi + size * rate, v) - pull(xi - size * rate, v)) / (2 * size)

    def at(self, t: float) -> tuple[Array, Array]:
        """Compute positions and rates at a time, shapes (nq,), (nv,).

        Raises:
            AssemblyError: The loops do not close there.
        """
        for end in (self._before, self._after):
            if t == end.t:
                return end.q.copy(), end.v.copy()
        h = self._after.t - self._before.t
        s = (t - self._before.t) / h
        powers, rates = s ** np.arange(6), np.concatenate([[0.0], np.arange(1, 6) * s ** np.arange(5)])
        xi = QUINTIC @ powers @ self._ends
        manifold = self._system.manifold
        q = manifold.retraction.move(self._before.q, xi)
        v = manifold.retraction.push(xi, QUINTIC @ rates @ self._ends / h)
        if manifold.looped:
            steps = self._system.law.steps  # the compiled path, unless the general one must close them
            lifted = None if steps is None else steps.lift(self._before.q, xi, v)
            q, v = manifold.project(q, v) if lifted is None else (lifted[0][0], lifted[0][2])
        self._system.law.place_base(t, q, v)
        return q, v


@dataclass(frozen=True)
class Event:
    """An event to detect: a zero of a function of time and state.

    Attributes:
        name: Name, for the result.
        function: Function of (t, q, v) that crosses zero; q of shape (nq,), v of shape (nv,).
        direction: +1 for rising zeros only, -1 for falling ones, 0 for both.
        terminal: Whether the event ends the run.

    Example:
        >>> robot = hybridyn.load("five_bar")
        >>> turned = hybridyn.Event("turned", lambda t, q, v: q[0] - 0.01, direction=1)
        >>> rest = [0.0] * robot.nv
        >>> run = hybridyn.simulate(robot, robot.home, rest, [0.0, 1.0], effort=[3.0, 0.0], events=[turned])
        >>> run.status, run.events[0].name, round(float(run.q[-1, 0]), 6)
        ('event', 'turned', 0.01)
    """

    name: str
    function: Callable[[float, Array, Array], float]
    direction: int = 0
    terminal: bool = True


@dataclass(frozen=True, eq=False)
class Found:
    """An event that occurred.

    Attributes:
        name: Name of the event.
        t: Time [s], to rounding of the step's dense output.
        q: Positions, shape (nq,).
        v: Rates, shape (nv,).
    """

    name: str
    t: float
    q: Array
    v: Array


def crossed(event: Event, before: float, after: float) -> bool:
    """Return whether an event's function crossed zero in the event's direction.

    A zero at the start of a step belongs to the step before and does not count again.
    """
    if before == 0.0 or np.sign(before) == np.sign(after):
        return False
    return event.direction == 0 or bool(np.sign(after - before) == event.direction)


def occurrences(
    event: Event, between: StepInterpolation, t0: float, before: float, after: float
) -> list[Found]:
    """Find all zeros of an event's function in a step, in the event's direction.

    Besides the ends of parts of the step, the extrema of parabolas through them are evaluated, where these
    come nearer to zero: a long step may hold a zero and the return.

    Args:
        event: The event.
        between: The step's dense output.
        t0: Start of the step [s].
        before: Value of the function there.
        after: Value at the end of the step.
    """

    def value(t: float) -> float:
        """Compute the event's function at a time of the step."""
        return event.function(t, *between.at(t))

    h = (between.end - t0) / PARTS
    points = [(t0, before), *((t, value(t)) for t in (t0 + k * h for k in range(1, PARTS)))]
    points.append((between.end, after))
    turns = []
    for (_, a), (t, b), (_, c) in zip(points, points[1:], points[2:], strict=False):
        bend = a - 2 * b + c
        if bend * b > 0 and abs(a - c) < 2 * abs(bend):  # an extremum towards zero, within both parts
            turns.append(t + h / 2 * (a - c) / bend)
    points = sorted([*points, *((t, value(t)) for t in turns)], reverse=h < 0)
    return [
        locate(event, between, start, end, x0)
        for (start, x0), (end, x1) in pairwise(points)
        if crossed(event, x0, x1)
    ]


def locate(event: Event, between: StepInterpolation, t0: float, t1: float, before: float) -> Found:
    """Find the first state at which an event's function has changed sign, by bisection.

    Args:
        event: The event, whose function changes sign between the times.
        between: The step's dense output.
        t0: Time before the zero [s].
        t1: Time after it [s].
        before: Value of the function at t0.
    """
    for _ in range(BISECTIONS):
        t = t0 + (t1 - t0) / 2
        if t in (t0, t1):
            break
        q, v = between.at(t)
        if np.sign(event.function(t, q, v)) == np.sign(before):
            t0 = t
        else:
            t1 = t
    return Found(event.name, t1, *between.at(t1))


def near_singularity(
    robot: HybridRobot, threshold: float = 1e-3, *, what: str = "closures", terminal: bool = True
) -> Event:
    """Build an event that occurs when a robot comes close to a singularity.

    Args:
        robot: The robot.
        threshold: Least singular value at which the event occurs: of the closure rows, relative to the
            largest (at least 1, the size of scaled rows), or of the motors' shares in the motions, of which
            the largest possible is 1.
        what: "closures": the closures are about to lose rank. "motors": the motors are about to lose a motion
            (parallel singularities), or the motions a motor.
        terminal: Whether the event ends the run.

    Raises:
        TrajectoryError: The threshold is no number from 0 to 1.

    Example:
        >>> robot = hybridyn.load("five_bar")
        >>> hybridyn.near_singularity(robot, 0.05, what="motors").name
        'singularity of the motors'
    """
    advice = "; a posture is given to the event: near_singularity(robot).function(t, q, v)"
    threshold = as_number(threshold, "threshold", 0.0, 1.0, advice)
    manifold = Manifold(robot)

    def closures(t: float, q: Array, v: Array) -> float:
        """Return how far the least singular value of the closures is above the threshold."""
        return manifold.chart(q).pivot - threshold

    def motors(t: float, q: Array, v: Array) -> float:
        """Return how far that of the motions of the motors is above it."""
        chart = manifold.chart(q)
        rows = (chart.at_origin(np.eye(chart.size)) / manifold.unit[:, None])[robot.motor_v]
        s = np.linalg.svd(rows, compute_uv=False)
        return float(s[-1]) - threshold if len(s) else 1.0

    one_of("what", what, "closures", "motors")
    return Event(f"singularity of the {what}", closures if what == "closures" else motors, -1, terminal)
