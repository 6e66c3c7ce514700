"""The gate: no time is taken of a model that is wrong."""

from __future__ import annotations

import numpy as np

import hybridyn
from hybridyn.spatial import Array

DDM_LIMIT = 1e-10  # of the largest acceleration
ROUND_TRIP_LIMIT = 1e-8  # ddm(idm(a)) against a: what the conditioning of a long stack leaves


class WrongModelError(Exception):
    """A model differs from its reference by more than its limit."""


def relative(found: Array, expected: Array) -> float:
    """Give the largest difference relative to the largest entry."""
    return float(np.abs(found - expected).max() / np.abs(expected).max())


def round_trip(robot: hybridyn.HybridRobot, q: Array, v: Array, a: Array) -> float:
    """Compare ddm(idm(a)) with a.

    Raises:
        WrongModelError: They differ.
    """
    error = relative(hybridyn.ddm(robot, q, v, hybridyn.idm(robot, q, v, a)), a)
    refuse(error, ROUND_TRIP_LIMIT, f"ddm(idm(a)) of {len(robot.modules)} modules")
    return error


def refuse(error: float, limit: float, what: str) -> None:
    """Raise where an error exceeds its limit."""
    if not error <= limit:
        raise WrongModelError(f"{what}: error {error:.1e}, limit {limit:.0e}")
