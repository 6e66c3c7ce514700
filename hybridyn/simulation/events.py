"""Events of a simulation: zeros of functions of time and state, located on the dense output."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..manifold.manifold import Manifold
from ..spatial import Array
from ..structure.robot import HybridRobot
from .dense_output import Between

#: Bisections of one step: its length over 2^52 is rounding.
BISECTIONS = 52


@dataclass(frozen=True)
class Event:
    """An event to detect: a zero of a function of time and state.

    Attributes:
        name: Name, for the result.
        function: Function of (t, q, v) that crosses zero; q of shape (nq,), v of shape (nv,).
        direction: +1 for rising zeros only, -1 for falling ones, 0 for both.
        terminal: Whether the event ends the run.
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


def locate(event: Event, between: Between, t0: float, before: float) -> Found:
    """Find the first state at which an event's function has changed sign, by bisection.

    Args:
        event: The event, whose function changes sign in the step.
        t0: Start of the step [s].
        before: Value of the function there.
    """
    t1 = between.end
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
        threshold: Least singular value, relative to the largest, at which the event occurs.
        what: "closures": the closures are about to lose rank. "motors": the motors are about to lose a motion
            (parallel singularities), or the motions a motor.
        terminal: Whether the event ends the run.
    """
    manifold = Manifold(robot)
    at = [robot.v_slices[robot.joints.index(name)].start for name in robot.motors]

    def closures(t: float, q: Array, v: Array) -> float:
        """Return how far the least singular value of the closures is above the threshold."""
        return manifold.chart(q).pivot - threshold

    def motors(t: float, q: Array, v: Array) -> float:
        """Return how far that of the motions of the motors is above it."""
        chart = manifold.chart(q)
        rows = (chart.at_origin(np.eye(chart.size)) / manifold.unit[:, None])[at]
        s = np.linalg.svd(rows, compute_uv=False)
        return float(s[-1] / s[0]) - threshold if len(s) and s[0] > 0 else 1.0

    if what not in ("closures", "motors"):
        raise ValueError(f"what must be 'closures' or 'motors', not {what!r}")
    return Event(f"singularity of the {what}", closures if what == "closures" else motors, -1, terminal)
