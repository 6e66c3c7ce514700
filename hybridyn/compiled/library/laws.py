"""Motor efforts for time steps in C: the structure `Law` of `c/laws.h`."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from ...errors import HybridynError, TrajectoryError
from ...spatial import Array, Index, Mask

#: Kinds of laws, in the order of `c/laws.h`.
KINDS = ("constant", "table", "pd", "torque", "function")
#: Roundings of a run's times, each half a unit in the last place: start plus steps, plus parts of a step.
LATE = 4
#: C function of the user's law: the efforts at a time, with positions and rates in arrays of `Law`.
Called = ctypes.PYFUNCTYPE(ctypes.c_int, ctypes.c_double)


class _Fields(ctypes.Structure):
    """The structure `Law` of `c/laws.h`."""

    _fields_ = (
        *((name, ctypes.c_longlong) for name in ("kind", "pieces", "holds")),
        ("latest", ctypes.c_double),
        *((name, ctypes.c_void_p) for name in ("bound", "time", "width", "piece", "kp", "kd", "at")),
        *((name, ctypes.c_void_p) for name in ("column", "turns", "close", "idm", "ddm", "function")),
        *((name, ctypes.c_void_p) for name in ("effort", "q", "v", "gain")),
    )


@dataclass(frozen=True, eq=False)
class Pieces:
    """Polynomials over time, one between each two times.

    Attributes:
        time: Their bounds, shape (pieces + 1,), [s].
        width: Unit of time of each piece and of the rest, shape (pieces + 1,), [s].
        c: Coefficients of (t - start) / width for each piece and the rest after the last, shape
            (pieces + 1, 6, motors).
        holds: Whether the rest is valid; else the polynomials end at the last time, but for rounding.
    """

    time: Array
    width: Array
    c: Array
    holds: bool

    @property
    def latest(self) -> float:
        """Latest time of the last polynomial: sums of a run's times may round beyond its end [s]."""
        end = float(self.time[-1])
        return end if self.holds else end + LATE * float(np.spacing(np.abs(self.time).max()))

    def check(self, what: str, t: Array) -> None:
        """Check that times are within the polynomials.

        Raises:
            TrajectoryError: A time is outside.
        """
        within = (t >= self.time[0]) & ((t <= self.latest) | self.holds)
        if not within.all():
            raise TrajectoryError(
                f"{what} runs from {self.time[0]:g} s to {self.time[-1]:g} s; "
                f"t = {t[~within][0]:g} s is outside"
            )

    def at(self, t: Array) -> tuple[Array, Array, Array]:
        """Compute values, first and second derivatives, shape (T, motors) each, with the bits of `c/laws.h`.

        Args:
            t: Times within the polynomials, shape (T,), [s].
        """
        i = np.clip(np.searchsorted(self.time, t, side="right") - 1, 0, len(self.c) - 2)
        over = t > self.latest
        i[over] = len(self.c) - 1
        h = self.width[i, None]
        s = np.where(over, 0.0, t - self.time[i])[:, None] / h
        c0, c1, c2, c3, c4, c5 = np.moveaxis(self.c[i], 1, 0)
        return (
            c0 + s * (c1 + s * (c2 + s * (c3 + s * (c4 + s * c5)))),
            (c1 + s * (2 * c2 + s * (3 * c3 + s * (4 * c4 + s * (5 * c5))))) / h,
            (2 * c2 + s * (6 * c3 + s * (12 * c4 + s * (20 * c5)))) / (h * h),
        )


class Axes(Protocol):
    """Indices of the motors in q and v, see `scenes.references.MotorAxes`."""

    @property
    def at(self) -> Index:
        """Index of the first coordinate in q."""
        ...

    @property
    def columns(self) -> Index:
        """Index of the coordinate in v."""
        ...

    @property
    def turns(self) -> Mask:
        """Whether q holds cosine and sine."""
        ...


class Law:
    """Motor efforts as a function of time and state that C evaluates.

    Attributes:
        at: Address of the structure.
        calls: Whether each evaluation calls a program in Python.
        pending: An error that the program raised, except errors of this package: those are left to the
            general path, which calls the program again.
    """

    def __init__(self, kind: str, **parts: Any) -> None:
        """Fill the structure.

        Args:
            kind: One of `KINDS`.
            parts: Its other fields: numbers, arrays, or addresses.
        """
        self._fields, self._kept = _Fields(kind=KINDS.index(kind)), parts
        self.at, self.calls = ctypes.addressof(self._fields), kind == "function"
        self.pending: BaseException | None = None
        for name, part in parts.items():
            setattr(self._fields, name, part.ctypes.data if isinstance(part, np.ndarray) else part)

    @staticmethod
    def constant(tau: Array) -> Law:
        """Return constant efforts."""
        return Law("constant", effort=np.ascontiguousarray(tau, dtype=float))

    @staticmethod
    def table(pieces: Pieces) -> Law:
        """Return efforts over time."""
        return Law("table", **_polynomials(pieces))

    @staticmethod
    def tracking(
        pieces: Pieces, axes: Axes, gains: tuple[Array, Array], models: Mapping[str, int] | None = None
    ) -> Law:
        """Return the control of the motors along a reference.

        Args:
            pieces: Positions of the motors over time.
            axes: The motors in q and v.
            gains: Gains of position and rate errors, shape (motors,) each.
            models: Addresses of the programs "close" and "idm", or of "ddm" alone, for computed torque; None
                for proportional-derivative control.
        """
        of_motors = {"at": axes.at, "column": axes.columns, "turns": axes.turns}
        own: dict[str, Any] = {name: np.ascontiguousarray(x, dtype=np.int64) for name, x in of_motors.items()}
        own |= {name: np.ascontiguousarray(x) for name, x in zip(("kp", "kd"), gains, strict=True)}
        if models is None:
            return Law("pd", **_polynomials(pieces), **own)
        if "ddm" in models:
            own["gain"] = np.empty((len(own["kp"]), len(own["kp"])))
        return Law("torque", **_polynomials(pieces), **own, **models)

    @staticmethod
    def function(effort: Callable[[float, Array, Array], Array], sizes: tuple[int, int, int]) -> Law:
        """Return efforts that a program in Python computes."""
        q, v, tau = (np.zeros(size) for size in sizes)
        shape = tau.shape

        def call(t: float) -> int:
            """Write the efforts at a time; return 0 if they can be used."""
            try:
                found = effort(t, q.copy(), v.copy())
                if np.shape(found) != shape:
                    return 1
                tau[:] = found
            except HybridynError:
                return 1
            except BaseException as error:
                law.pending = error
                return 1
            return 0

        called = Called(call)
        address = ctypes.cast(called, ctypes.c_void_p).value
        law = Law("function", q=q, v=v, effort=tau, function=address)
        law._kept["called"] = called
        return law

    def bounded(self, bound: Array) -> Law:
        """Clip the efforts to limits, shape (motors,), and return this law."""
        self._kept["bound"] = bound = np.ascontiguousarray(bound, dtype=float)
        self._fields.bound = bound.ctypes.data
        return self

    def check_pending(self) -> None:
        """Raise the error that the program in Python raised, if any."""
        if (error := self.pending) is not None:
            self.pending = None
            raise error


def _polynomials(pieces: Pieces) -> dict[str, Any]:
    """Return the fields of a reference."""
    parts = {"time": pieces.time, "width": pieces.width, "piece": pieces.c}
    own: dict[str, Any] = {name: np.ascontiguousarray(x, dtype=float) for name, x in parts.items()}
    return own | {"pieces": len(pieces.c) - 1, "holds": int(pieces.holds), "latest": pieces.latest}
