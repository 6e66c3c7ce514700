"""References whose own error is shown, the oracle in more digits than double precision; and the gate.

- `digits`: mpmath, 40 digits; its error is nothing.
- `extended`: NumPy's long double where it has 64 bits of mantissa or more (x86), at any size. Its error is
  known on small robots (against 40 digits), and estimated on others: what the oracle loses in double
  precision, divided by the ratio of the roundings.
- The states are doubles. How much the answer moves when loops are closed exactly, and not to rounding, is
  what no method can avoid: `floor`.
- The gate: no time is taken of a model that is wrong.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

import hybridyn
from hybridyn import HybridRobot
from hybridyn.spatial import Array
from hybridyn.studies.compare.methods import Model
from tests.oracle import Extended, Oracle

#: Of the largest acceleration.
DDM_LIMIT = 1e-10
#: ddm(idm(a)) against a: the condition of a stack grows with the cube of its height.
ROUND_TRIP, LEAST_ROUND_TRIP = 4e-14, 1e-12
DIGITS = 40
#: Velocities up to which 40 digits take about a second per sample.
SMALL = 24


class LongDouble(Extended):
    """Arrays of NumPy's long double; factors as in `Extended`."""

    def __init__(self) -> None:
        self.epsilon = float(np.finfo(np.longdouble).eps)
        self.sin, self.cos, self.sqrt, self.atan2 = np.sin, np.cos, np.sqrt, np.arctan2

    def array(self, values: Any) -> Any:
        """Copy `values` into an array of long doubles."""
        return np.array(values, dtype=np.longdouble)


@dataclass(frozen=True)
class Reference:
    """Answers to judge by.

    Attributes:
        values: The model at each state, shape (states, n), rounded to long doubles.
        error: Estimate of their own error, relative to the largest entry.
        kind: How they were made.
    """

    values: Any
    error: float
    kind: str

    def off(self, found: Array) -> float:
        """Return the worst state's largest error, relative to the largest entry of its reference."""
        if not np.isfinite(found).all():
            return float("inf")
        return max(
            float(np.abs(x - y).max() / np.abs(y).max()) for x, y in zip(found, self.values, strict=True)
        )


def refer(robot: HybridRobot, model: Model, q: Array, v: Array, given: Array) -> Reference:
    """Compute references at some states.

    Args:
        robot: The robot.
        model: "ddm" (given: efforts) or "idm" (given: accelerations).
        q: Positions, shape (T, nq).
        v: Rates, shape (T, nv).
        given: Efforts or accelerations, shape (T, n).
    """
    double = answers(Oracle(robot.description, robot.base), model, q, v, given)
    if robot.nv <= SMALL:
        values = digits(robot, model, q, v, given)
        return Reference(values, float(np.finfo(np.longdouble).eps), f"{DIGITS} digits")
    values, gain = extended(robot, model, q, v, given)
    return Reference(values, Reference(values, 0.0, "").off(double) * gain, "long double")


def digits(robot: HybridRobot, model: Model, q: Array, v: Array, given: Array) -> Any:
    """Return answers computed in 40 digits, rounded to long doubles."""
    import mpmath

    with mpmath.workdps(DIGITS):
        found = answers(
            Oracle(robot.description, robot.base, arithmetic=Extended(mpmath.mp)), model, q, v, given
        )
        texts = [mpmath.nstr(x, 30) for x in found.flat]
    return np.array([np.longdouble(text) for text in texts]).reshape(found.shape)


def extended(robot: HybridRobot, model: Model, q: Array, v: Array, given: Array) -> tuple[Any, float]:
    """Return answers in long double, and how much finer its rounding is than that of doubles."""
    arithmetic = LongDouble()
    gain = arithmetic.epsilon / float(np.finfo(float).eps)
    return answers(Oracle(robot.description, robot.base, arithmetic=arithmetic), model, q, v, given), gain


def answers(oracle: Oracle, model: Model, q: Array, v: Array, given: Array) -> Any:
    """Return an oracle's answers at some states."""
    call = oracle.ddm if model == "ddm" else oracle.idm
    return np.array([call(*state) for state in zip(q, v, given, strict=True)])


def floor(robot: HybridRobot, q: Array, v: Array, tau: Array) -> float:
    """Return how much the direct model moves when one state's loops are closed to the last digit.

    Args:
        robot: The robot.
        q: Positions, shape (nq,).
        v: Rates, shape (nv,).
        tau: Efforts, shape (motors,).
    """
    oracle = Oracle(robot.description, robot.base, arithmetic=LongDouble())
    as_given, closed = oracle.ddm(q, v, tau), oracle.close(q)
    exact = oracle.ddm(closed, oracle.project_velocity(closed, v), tau)
    return float(np.abs(exact - as_given).max() / np.abs(as_given).max())


class WrongModelError(Exception):
    """A model differs from its reference by more than its limit."""


def relative(found: Array, expected: Array) -> float:
    """Return the largest difference relative to the largest entry."""
    return float(np.abs(found - expected).max() / np.abs(expected).max())


def round_trip_limit(modules: int) -> float:
    """Return what ddm(idm(a)) may differ from a by, relative to its largest entry."""
    return max(LEAST_ROUND_TRIP, ROUND_TRIP * modules**3)


def round_trip(robot: hybridyn.HybridRobot, q: Array, v: Array, a: Array) -> float:
    """Compare ddm(idm(a)) with a.

    Raises:
        WrongModelError: They differ.
    """
    error = relative(hybridyn.ddm(robot, q, v, hybridyn.idm(robot, q, v, a)), a)
    refuse(error, round_trip_limit(len(robot.modules)), f"ddm(idm(a)) of {len(robot.modules)} modules")
    return error


def refuse(error: float, limit: float, what: str) -> None:
    """Raise where an error exceeds its limit."""
    if not error <= limit:
        raise WrongModelError(f"{what}: error {error:.1e}, limit {limit:.0e}")
