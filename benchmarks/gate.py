"""The gate: no time is taken of a model that is wrong."""

from __future__ import annotations

import numpy as np

import hybridyn
from hybridyn.spatial import Array

#: Of the largest acceleration.
DDM_LIMIT = 1e-10
#: ddm(idm(a)) against a: the condition of a stack grows with the cube of its height.
ROUND_TRIP, LEAST_ROUND_TRIP = 4e-14, 1e-12


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
