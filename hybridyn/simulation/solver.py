"""The options of a solver: method, length of steps, tolerances, and projection on the closures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypedDict, Unpack

import numpy as np

from ..description.names import did_you_mean
from ..errors import TrajectoryError
from ..spatial import LARGEST

#: What other programs call the arguments of `simulate`.
OTHER_WORDS = {
    "dt": "step",
    "h": "step",
    "timestep": "step",
    "tau": "effort",
    "t_eval": "output_times",
    "tol": "rtol",
}
METHODS = ("rk4", "dopri5", "implicit", "conserving")
PROJECTIONS = ("stages", "steps", "never")


@dataclass(frozen=True)
class Solver:
    """Options of the time integration.

    Attributes:
        method: "dopri5": adaptive, orders 5 and 4. "rk4": fixed steps, order 4. "implicit": L-stable, order
            3, for stiff scenes, adaptive unless `step` is given. "conserving": fixed steps, order 2,
            conserves energy.
        step: Length of fixed steps [s]; for "dopri5" the length of the first step.
        rtol: Tolerance of one step's error (adaptive methods): of rates relative to the largest scaled rate,
            of positions per radian or module length.
        atol: Absolute tolerance, added to it, in radians and module lengths, and those per second.
        projection: "stages": every stage is assembled, closures never open. "steps": closures may open within
            a step and are closed after it where they are open by more than 1e-11. "never": they drift; for
            comparison.
        baumgarte: Rate [1/s] of Baumgarte's stabilisation, with projection="never"; for comparison.
    """

    method: str = "dopri5"
    step: float | None = None
    rtol: float = 1e-8
    atol: float = 1e-10
    projection: str = "stages"
    baumgarte: float | None = None

    def __post_init__(self) -> None:
        """Check the options.

        Raises:
            TrajectoryError: An unknown method or projection, a missing step, numbers that are not positive,
                or options that exclude each other.
        """
        if self.method not in METHODS:
            raise TrajectoryError(f"unknown method {self.method!r}; choose one of {', '.join(METHODS)}")
        if self.projection not in PROJECTIONS:
            raise TrajectoryError(
                f"projection must be one of {', '.join(PROJECTIONS)}, not {self.projection!r}"
            )
        for name in ("step", "rtol", "atol", "baumgarte"):
            x = getattr(self, name)
            if x is not None and not (np.isfinite(x) and x > 0):
                raise TrajectoryError(f"{name} must be positive, not {x}")
        if self.baumgarte is not None and self.baumgarte > LARGEST:
            raise TrajectoryError(f"baumgarte must be at most {LARGEST:.0e}, not {self.baumgarte:g}")
        if self.method in ("rk4", "conserving") and self.step is None:
            raise TrajectoryError(f"method '{self.method}' takes fixed steps: give step [s]")
        if self.method in ("conserving", "implicit") and self.projection != "stages":
            raise TrajectoryError(
                f"method '{self.method}' works on closed loops only: projection must be 'stages'"
            )
        if self.baumgarte is not None and self.projection != "never":
            raise TrajectoryError(
                "baumgarte needs projection='never': projected closures need no stabilisation"
            )

    @property
    def fixed(self) -> float | None:
        """Length of every step [s], or None where the error estimate chooses it."""
        return None if self.method == "dopri5" else self.step

    @property
    def error_order(self) -> int:
        """Order of the error estimate plus one."""
        return 5 if self.method == "dopri5" else 3


class SolverOptions(TypedDict, total=False):
    """The fields of `Solver` as keywords of `simulate`."""

    method: str
    step: float | None
    rtol: float
    atol: float
    projection: str
    baumgarte: float | None


def choose_solver(solver: Solver | None, **options: Unpack[SolverOptions]) -> Solver:
    """Return the solver, built from keywords where none is given.

    Raises:
        TrajectoryError: Both are given, or the options are wrong.
        TypeError: `simulate` has no such argument.
    """
    for name in options:
        if name not in SolverOptions.__annotations__:
            meant = OTHER_WORDS.get(name)
            hint = (
                f" (did you mean '{meant}'?)" if meant else did_you_mean(name, SolverOptions.__annotations__)
            )
            raise TypeError(f"simulate has no argument '{name}'{hint}")
    if solver is None:
        return Solver(**options)
    if options:
        given = ", ".join(options)
        raise TrajectoryError(f"give either solver= or {given}: a solver has all its options in itself")
    return solver
