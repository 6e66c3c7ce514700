"""Take time steps in a built library: `integrators.Explicit` in C, and charts of independent joints."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass

import numpy as np

from ...manifold.manifold import Posture
from ...manifold.module_chart import AmbiguousBranchError
from ...spatial import Array, Index
from .laws import Law


class Tableau(ctypes.Structure):
    """The numbers of an explicit Runge-Kutta method, the structure `Tableau` of `c/steps.h`."""

    _fields_ = (("stages", ctypes.c_longlong), *((name, ctypes.c_void_p) for name in ("A", "b", "c", "e")))

    def __init__(self, A: Array, b: Array, e: Array | None) -> None:
        """Copy the weights of the stages, of the result, and of its error, if any."""
        numbers = {"A": A, "b": b, "c": np.array([row.sum() for row in A]), "e": e}
        self._kept = {n: np.ascontiguousarray(x, dtype=float) for n, x in numbers.items() if x is not None}
        super().__init__(stages=len(b), **{n: x.ctypes.data for n, x in self._kept.items()})


class Control(ctypes.Structure):
    """How the estimated error chooses the lengths of steps, the structure `Control` of `c/steps.h`.

    Attributes:
        end: End of the run [s].
        rtol, atol: Tolerances of one step.
        power: Exponent of the error in the factor of the next length.
        shortest: Shortest length [s].
        same_point: Distance to the end, in steps, below which a step goes there.
        unit: Address of the units of displacements and rates.
    """

    _fields_ = (
        *((name, ctypes.c_double) for name in ("end", "rtol", "atol", "power", "shortest", "same_point")),
        ("unit", ctypes.c_void_p),
    )

    def __init__(self, unit: Array, **numbers: float) -> None:
        """Take the numbers, and the units, shape (nv,)."""
        self._kept = np.ascontiguousarray(unit, dtype=float)
        super().__init__(unit=self._kept.ctypes.data, **numbers)


@dataclass(frozen=True, eq=False)
class Taken:
    """States after the steps taken.

    Attributes:
        t: Times of the start and after each step, shape (steps + 1,), [s].
        q, v, a: States after each step, shapes (steps, nq), (steps, nv), (steps, nv).
        pivot: Smallest pivot of the closures in each step, over its usual size, shape (steps,).
        next_step: Length of the step that is to follow each one, shape (steps,), [s].
        rejected: How often each step was repeated with a shorter length, shape (steps,).
        shortened: Whether the step that could not be taken was a repeated one.
        error: Estimated errors of positions and rates over the last step, shape (2, nv), or None.
    """

    t: Array
    q: Array
    v: Array
    a: Array
    pivot: Array
    next_step: Array
    rejected: Index
    shortened: bool
    error: Array | None


class Steps:
    """The functions of `c/steps.h`. They hold the interpreter's lock, which protects their workspace.

    Attributes:
        freedoms: Number of the robot's freedoms.
        motors: Number of its motors.
        independent: Freedoms that the closures leave independent.
    """

    def __init__(self, held: ctypes.PyDLL, lifted: list[tuple[str, int]], motors: int) -> None:
        """Find the functions.

        Args:
            lifted: Names and lengths of the outputs of the program "lift".
            motors: Number of motors.
        """
        self._steps, self._lift = held.explicit_steps, held.lifted_posture
        self._steps.restype = ctypes.c_longlong
        self._steps.argtypes = [ctypes.c_longlong, *[ctypes.c_void_p] * 12]
        self._efforts = held.law_efforts
        self._efforts.restype = ctypes.c_longlong
        self._efforts.argtypes = [ctypes.c_void_p, ctypes.c_longlong, *[ctypes.c_void_p] * 4]
        self._room = ctypes.c_longlong.in_dll(held, "steps_work").value
        self._lift.restype = ctypes.c_int
        self._lift.argtypes = [ctypes.c_void_p] * 5
        self._ends = np.cumsum([size for _, size in lifted])
        self._parts = [slice(end - size, end) for end, (_, size) in zip(self._ends, lifted[:4], strict=False)]
        nq, nv = lifted[0][1], lifted[1][1]
        out, pivot = np.empty(self._ends[-1]), np.ones(1)
        nowhere = np.zeros(nq), np.zeros(nv), np.zeros(nv)
        self._lift(*(x.ctypes.data for x in (*nowhere, out, pivot)))  # "independent" is the same everywhere
        self.freedoms, self.motors = nv, motors
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
        return [out[at] for at in self._parts], float(pivot[0])

    def take(
        self, tableau: Tableau, law: Law, state: tuple[Array, Array, Array], t: Array, h: float,
        control: Control | None = None,
    ) -> Taken:  # fmt: skip
        """Take steps as long as they can be trusted.

        Args:
            state: Assembled positions, rates and accelerations, shapes (nq,), (nv,), (nv,).
            t: Times of the start and after each step, shape (steps + 1,), [s]; with `control`, only the
                first is read.
            h: Length of the steps, with `control` of the first one [s].
            control: Chooses the lengths of the steps; None for equal ones.

        Returns:
            The states after the steps; fewer than asked for if the general path must take the next step, or
            if the end is reached.

        Raises:
            BaseException: What a law in Python raised before, at the first step that it made impossible.
        """
        law.check_pending()
        count = len(t) - 1
        rows = [np.empty((count + 1, len(x))) for x in state]
        for row, x in zip(rows, state, strict=True):
            row[0] = x
        times, lengths = t.copy(), np.full(count + 1, h)
        rejected, pivots = np.empty(count, np.int64), np.empty(count)
        error, work = np.empty((2, len(state[1]))), np.empty(self._room, np.uint8)
        arrays = (times, lengths, rejected, *rows, pivots, error, work)
        taken = self._steps(
            count, ctypes.addressof(tableau), None if control is None else ctypes.addressof(control), law.at,
            *(x.ctypes.data for x in arrays),
        )  # fmt: skip
        if not taken:
            law.check_pending()
        q, v, a = (row[1 : taken + 1] for row in rows)
        times, lengths = times[: taken + 1], lengths[1 : taken + 1]
        shortened = taken < count and bool(rejected[taken])
        return Taken(times, q, v, a, pivots[:taken], lengths, rejected[:taken], shortened, error)

    def efforts(self, law: Law, t: Array, q: Array, v: Array) -> Array | None:
        """Compute a law's efforts, shape (T, motors), at states of shapes (T,), (T, nq), (T, nv).

        Returns:
            The efforts; None if the general path must compute them.
        """
        arrays = [np.ascontiguousarray(x, dtype=float) for x in (t, q, v)]
        out = np.empty((len(t), self.motors))
        done = self._efforts(law.at, len(t), *(x.ctypes.data for x in arrays), out.ctypes.data)
        return out if done == len(t) else None


class JointChart:
    """A chart like `chart.Chart` about an assembled posture, whose coordinates are the independent joints.

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
        return x[self._independent]

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
