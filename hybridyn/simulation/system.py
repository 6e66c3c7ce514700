"""The integrated system: states, accelerations on the manifold, and the charts in which steps are taken."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np

from ..compiled import JointChart
from ..manifold.manifold import Chart, Manifold, Posture
from ..manifold.module_chart import AmbiguousBranchError
from ..spatial import Array
from .motion_law import MotionLaw, StepError

#: Coordinates of the manifold about a posture: of the tangent space there, or of the compiled path.
Coordinates: TypeAlias = Chart | JointChart

#: Largest difference between rates and their prediction, relative to speed, where another branch is near.
TURN = 0.3


@dataclass(frozen=True, eq=False)
class State:
    """A robot at one moment.

    Attributes:
        t: Time [s].
        q: Positions, shape (nq,), assembled.
        v: Rates, shape (nv,).
        a: Accelerations, shape (nv,).
        signs: Directions of joints with stiction, 0 of those that stick, shape (k,), unit vectors of balls;
            empty without it.
    """

    t: float
    q: Array
    v: Array
    a: Array
    signs: Array = field(default_factory=lambda: np.zeros(0))


@dataclass(frozen=True, eq=False)
class Stepped:
    """The result of one step.

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


@dataclass(frozen=True)
class System:
    """The integrated system.

    Attributes:
        manifold: The manifold of assembled postures.
        law: The accelerations.
    """

    manifold: Manifold
    law: MotionLaw

    def posture(
        self, chart: Coordinates, t: float, y: Array, u: Array, start: State | None = None
    ) -> Posture:
        """Compute a chart's posture, with a prescribed base at its pose.

        Args:
            t: Time [s].
            y: Coordinates, shape (N,).
            u: Velocities, shape (N,).
            start: The state at the chart's origin, from which the posture is predicted.

        Raises:
            AssemblyError: The loops do not close there.
            AmbiguousBranchError: Another branch is too near, or reached.
            StepError: The coordinates are not finite.
        """
        if not (np.isfinite(y).all() and np.isfinite(u).all()):
            raise StepError(f"at t = {t:g} s the motion is not finite")
        if start is None:
            p = chart.lift(y, u)
        else:
            h = t - start.t
            p = chart.lift(y, u, h * start.v + h * h / 2 * start.a)
            predicted, unit = start.v + h * start.a, self.manifold.unit
            off, size = (float(np.abs(x / unit).max(initial=0.0)) for x in (p.v - predicted, predicted))
            if off > TURN * size and chart.narrow:
                raise AmbiguousBranchError(
                    f"at t = {t:g} s, next to postures where closures lose rank, the motion turns away from "
                    "where it was heading: that is another branch, or the step is too long"
                )
        self.law.place_base(t, p.q, p.v)
        return p

    def rates(self, chart: Coordinates, t: Array, postures: list[Posture]) -> tuple[Array, Array, Array]:
        """Compute y_dot, u_dot and the accelerations of postures, shapes (T, N), (T, N), (T, nv)."""
        a = self.law.accelerations(t, np.array([p.q for p in postures]), np.array([p.v for p in postures]))
        pull = self.manifold.retraction.pull
        y_dot = np.array([chart.independent(pull(p.xi, p.v)) for p in postures])
        return y_dot, chart.independent(a.T).T, a


def in_quickest_chart(system: System, state: State, step: Callable[[Coordinates], Stepped]) -> Stepped:
    """Take a step in the compiled path's chart where that is valid, else in a chart of the tangent space.

    Raises:
        AssemblyError, StepError: What `step` raises in the chart of the tangent space.
    """
    if system.law.steps is not None:
        with contextlib.suppress(AmbiguousBranchError):
            return step(JointChart(system.law.steps, state.q))
    return step(system.manifold.chart(state.q, state.v))


def weighted(weights: Array, k: list[Array]) -> Array:
    """Compute the weighted sum of stages, leaving out zero weights."""
    out = np.zeros_like(k[0]) if k else np.zeros(())
    for w, x in zip(weights, k, strict=False):
        if w:
            out = out + w * x
    return out
