"""Steps in time by a built library: `integrators.Explicit` in C, and charts of independent joints."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass

import numpy as np

from ...manifold.chart import AmbiguousBranchError, Posture
from ...spatial import Array


@dataclass(frozen=True)
class Taken:
    """Steps that were taken.

    Attributes:
        q, v, a: States after each step, shapes (steps, nq), (steps, nv), (steps, nv).
        pivot: Least pivot of the closures met in each step, over its usual size, shape (steps,).
        error_q, error_v: Estimated errors of the last step, shape (nv,), or None.
    """

    q: Array
    v: Array
    a: Array
    pivot: Array
    error_q: Array | None
    error_v: Array | None


class Steps:
    """The functions of `c/steps.h`; they keep the interpreter's lock, and so their own memory.

    Attributes:
        freedoms: Number of the robot's freedoms.
        independent: Those that the closures leave independent.
    """

    def __init__(self, held: ctypes.PyDLL, lifted: list[tuple[str, int]]) -> None:
        """Find the functions.

        Args:
            held: The library.
            lifted: Names and lengths of what a lifted posture consists of.
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
        self._lift(*(x.ctypes.data for x in (*nowhere, out, pivot)))  # whether closed or not: it is the same
        self.freedoms = nv
        self.independent = np.flatnonzero(out[self._ends[3] : self._ends[4]])

    def lift(self, q_0: Array, xi: Array, v: Array) -> tuple[list[Array], float] | None:
        """Close the loops from a displacement on, with the independent rates of v.

        Returns:
            Positions (nq,); displacement, rates, rate of the displacement, (nv,) each; the least pivot met.
            None where that is left to the general path.
        """
        out, pivot = np.empty(self._ends[-1]), np.ones(1)
        given = [np.ascontiguousarray(x) for x in (q_0, xi, v)]
        if self._lift(*(x.ctypes.data for x in given), out.ctypes.data, pivot.ctypes.data):
            return None
        return np.split(out, self._ends[:4])[:4], float(pivot[0])

    def chart(self, q: Array) -> JointChart:
        """Lay a chart about an assembled posture."""
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
            tableau: Weights A of the stages, b of the result, e of its error or None.
            state: Assembled positions, rates and accelerations, shapes (nq,), (nv,), (nv,).
            tau: Efforts, shape (motors,).
            h: Length of a step [s].
            count: Number of steps.

        Returns:
            The steps taken; fewer than `count` where the general path must take the next.
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
        pivot: Least pivot met so far, over its usual size.
        narrow: Never true: where another branch is near, nothing is lifted.
    """

    narrow = False

    def __init__(self, steps: Steps, q: Array) -> None:
        self._steps, self._q = steps, q
        self._independent, self._xi = steps.independent, np.zeros(steps.freedoms)
        self.size, self.pivot = len(steps.independent), 1.0

    def independent(self, x: Array) -> Array:
        """Return the coordinates' share of rates, accelerations or displacements, shape (nv,) or (nv, k)."""
        out: Array = x[self._independent]
        return out

    def lift(self, y: Array, u: Array, near: Array | None = None) -> Posture:
        """Return posture and rates, as `Chart.lift`.

        Raises:
            AmbiguousBranchError: It is left to the general path.
        """
        xi = self._xi.copy() if near is None else near.copy()
        v = np.zeros_like(xi)
        xi[self._independent], v[self._independent] = y, u
        lifted = self._steps.lift(self._q, xi, v)
        if lifted is None:
            raise AmbiguousBranchError("the dependent joints are too near to losing hold of the others")
        (q, self._xi, v, _), pivot = lifted
        self.pivot = min(self.pivot, pivot)
        return Posture(q, self._xi, v)

    def rates(self, u: Array) -> Array:
        """Return the rates of u at the posture that `lift` gave last, shape (nv,)."""
        return self.lift(self.independent(self._xi), u).v
