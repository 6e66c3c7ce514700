"""Options of the time integration, and the method of a name."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TypedDict

import numpy as np

from ..description.names import did_you_mean
from ..errors import TrajectoryError
from .conserving import Conserving
from .runge_kutta import DOPRI5, RK4, Explicit, Implicit
from .system import System

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

Method = Explicit | Implicit | Conserving


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
        stiction: Whether joints with dry friction stick: they hold still until the load exceeds what they
            hold, and slide with friction whose sign is not smoothed.
    """

    method: str = "dopri5"
    step: float | None = None
    rtol: float = 1e-8
    atol: float = 1e-10
    stiction: bool = False

    def __post_init__(self) -> None:
        """Check the options.

        Raises:
            TrajectoryError: An unknown method, a missing step, or numbers that are not positive.
        """
        if self.method not in METHODS:
            raise TrajectoryError(f"unknown method {self.method!r}; choose one of {', '.join(METHODS)}")
        for name in ("step", "rtol", "atol"):
            x = getattr(self, name)
            if x is not None and not (np.isfinite(x) and x > 0):
                raise TrajectoryError(f"{name} must be positive, not {x}")
        if self.method in ("rk4", "conserving") and self.step is None:
            raise TrajectoryError(f"method '{self.method}' takes fixed steps: give step [s]")
        if self.stiction and self.method == "conserving":
            raise TrajectoryError("method 'conserving' has no stiction: choose 'dopri5', 'rk4' or 'implicit'")

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
    stiction: bool


def solver_of(options: SolverOptions) -> Solver:
    """Return the solver of keywords.

    Raises:
        TrajectoryError: The options are wrong.
        TypeError: `simulate` has no such argument.
    """
    known = [field.name for field in fields(Solver)]
    for name in options:
        if name not in known:
            meant = OTHER_WORDS.get(name)
            hint = f" (did you mean '{meant}'?)" if meant else did_you_mean(name, known)
            raise TypeError(f"simulate has no argument '{name}'{hint}")
    return Solver(**options)


def build_method(method: str, system: System) -> Method:
    """Build the method of a name."""
    if method == "conserving":
        return Conserving(system.law)
    others: dict[str, Method] = {"rk4": RK4, "dopri5": DOPRI5, "implicit": Implicit()}
    return others[method]
