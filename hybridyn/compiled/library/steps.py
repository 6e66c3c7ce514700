"""Take time steps in a built library: `integrators.Explicit` in C, and charts of independent joints."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass

import numpy as np

from ...manifold.chart import AmbiguousBranchError, Posture
from ...spatial import Array


@dataclass(frozen=True)
class Taken:
    """States after the steps taken.

    Attributes:
        q, v, a: States after each step, shapes (steps, nq), (steps, nv), (steps, nv).
        pivot: Smallest pivot of the closures in each step, over its usual size, shape (steps,).
        error_q, error_v: Estimated errors of the last step, shape (nv,), or None.
    """

    q: Array
    v: Array
    a: Array
    pivot: Array
    error_q: Array | None
    error_v: Array | None


class Steps:
    """The functions of `c/steps.h`. They hold the interpreter's lock, which protects their workspace.

    Attributes:
        freedoms: Number of the robot's freedoms.
        independent: Freedoms that the closures leave independent.
    """

    def __init__(self, held: ctypes.PyDLL, lifted: list[tuple[str, int]]) -> None:
        """Find the functions.

        Args:
            held: The library.
            lifted: Names and lengths of the outputs of the program "lift".
        """
        self._steps, self._lift = held.explicit_steps, held.lifted_posture
        self._steps.restype = ctypes.c_longlong
        self._steps.argtypes = [ctypes.c_longlong, ctypes.c_double, ctypes.c_int, *[ctypes.c_void_p] * 9]
        self._lift.restype = ctypes.c_int
        self._lift.argtypes = [ctypes.c_void_p] * 5
        self._ends = np.cumsum([size for _, size in lifted])
        nq, nv = lifted[0][1], lifted[1][1]
        out, pivot = np.empty(self._ends[-1]), np.ones(1)
        nowhere = np.zeros(nq), np.zeros(nv), np.zeros(nv)
        self._lift(*(x.ctypes.data for x in (*nowhere, out, pivot)))  # "independent" is the same everywhere
        self.freedoms = nv
        self.independent = np.flatnonzero(out[self._ends[3] : self._ends[4]])

    def lift(self, q_0: Array, xi: Array, v: Array) -> tuple[list[Array], float] | None:
        """Close the loops by Newton's method from a displacement, with the independent rates of v.

        Returns:
            Positions, shape (nq,); displacement, rates and rate of the displacement, shape (nv,) each; and
            the smallest pivot met. None if the general path must do it.
        """
        out, pivot = np.empty(self._ends[-1]), np.ones(1)
        given = [np.ascontiguousarray(x) for x in (q_0, xi, v)]
        if self._lift(*(x.ctypes.data for x in given), out.ctypes.data, pivot.ctypes.data):
            return None
        return np.split(out, self._ends[:4])[:4], float(pivot[0])

    def chart(self, q: Array) -> JointChart:
        """Return a chart about an assembled posture."""
        return JointChart(self, q)

    def take(
        self,
        tableau: tuple[Array, Array, Array | None],
        state: tuple[Array, Array, Array],
        tau: Array,
        h: float,
        count: int,
    ) -> Taken:
        """Take steps as long as they can be trusted.

        Args:
            tableau: Weights A of the stages, b of the result, and e of its error or None.
            state: Assembled positions, rates and accelerations, shapes (nq,), (nv,), (nv,).
            tau: Efforts, shape (motors,).
            h: Length of a step [s].
            count: Number of steps.

        Returns:
            The states after the steps; fewer than `count` if the general path must take the next step.
        """
        rows = [np.empty((count + 1, len(x))) for x in state]
        for row, x in zip(rows, state, strict=True):
            row[0] = x
        pivots, errors = np.empty(count), np.empty((2, len(state[1])))
        weights = [None if x is None else np.ascontiguousarray(x, dtype=float) for x in tableau]
        own = np.ascontiguousarray(tau, dtype=float)
        taken = self._steps(
            count, h, len(tableau[1]), *(None if x is None else x.ctypes.data for x in weights),
            own.ctypes.data, *(row.ctypes.data for row in rows), pivots.ctypes.data, errors.ctypes.data,
        )  # fmt: skip
        q, v, a = (row[1 : taken + 1] for row in rows)
        error_q, error_v = (None, None) if tableau[2] is None else errors
        return Taken(q, v, a, pivots[:taken], error_q, error_v)


class JointChart:
    """A chart like `chart.Chart` whose coordinates are the independent joints.

    Attributes:
        size: Number of coordinates.
        pivot: Smallest pivot met so far, over its usual size.
        narrow: Always false: `lift` raises near another branch.
    """

    narrow = False

    def __init__(self, steps: Steps, q: Array) -> None:
        self._steps, self._q = steps, q
        self._independent, self._xi = steps.independent, np.zeros(steps.freedoms)
        self.size, self.pivot = len(steps.independent), 1.0

    def independent(self, x: Array) -> Array:
        """Return the independent entries of rates, accelerations or displacements, (nv,) or (nv, k)."""
        out: Array = x[self._independent]
        return out

    def lift(self, y: Array, u: Array, near: Array | None = None) -> Posture:
        """Compute posture and rates, like `Chart.lift`.

        Raises:
            AmbiguousBranchError: The general path must lift this posture.
        """
        xi = self._xi.copy() if near is None else near.copy()
        v = np.zeros_like(xi)
        xi[self._independent], v[self._independent] = y, u
        lifted = self._steps.lift(self._q, xi, v)
        if lifted is None:
            raise AmbiguousBranchError("the dependent joints are too near to a singularity of the closures")
        (q, self._xi, v, _), pivot = lifted
        self.pivot = min(self.pivot, pivot)
        return Posture(q, self._xi, v)

    def rates(self, u: Array) -> Array:
        """Compute the rates of u at the posture of the last `lift`, shape (nv,)."""
        return self.lift(self.independent(self._xi), u).v
