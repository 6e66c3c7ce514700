"""Dense output: states between the ends of a step, on the joints' manifolds and on the closures.

Positions follow the quintic Hermite polynomial of the displacement xi, its rate and its second rate at both
ends; rates are its derivative. The result is projected on the closures, as every other state.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from ..spatial import Array
from .system import State, System

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


class Between:
    """Interpolation of the states within one step."""

    def __init__(self, system: System, before: State, after: State, *, exact: bool, project: bool) -> None:
        """Set the ends of the step.

        Args:
            before: Start of the step.
            after: End of the step.
            exact: True where both ends carry the direct model's accelerations.
            project: Whether states are projected on the closures.
        """
        self._system, self._before, self._after = system, before, after
        self._exact, self._project = exact, project

    @property
    def end(self) -> float:
        """End of the step [s]."""
        return self._after.t

    @cached_property
    def _ends(self) -> Array:
        """Value, first and second rate of xi at both ends, times powers of h, shape (6, nv)."""
        retraction = self._system.manifold.retraction
        h = self._after.t - self._before.t
        a0, a1 = (self._acceleration(s) for s in (self._before, self._after))
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

    def _acceleration(self, state: State) -> Array:
        if self._exact:
            return state.a
        return self._system.law.acceleration(state.t, state.q.copy(), state.v.copy())

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
        if self._project and manifold.looped:
            lifted = self._system.lift(self._before, xi, v)
            q, v = manifold.project(q, v) if lifted is None else lifted
        self._system.law.place_base(t, q, v)
        return q, v
