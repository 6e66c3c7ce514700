"""The gate: no time is taken of a model that is wrong."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

import hybridyn
from benchmarks.cases import stack, stack_states
from benchmarks.results import Result
from hybridyn.oracle import Oracle
from hybridyn.spatial import Array

STATES = 3
IDM_LIMIT = 1e-11  # of the largest effort
DDM_LIMIT = 1e-10  # of the largest acceleration
ROUND_TRIP_LIMIT = 1e-8  # ddm(idm(a)) against a: what the conditioning of a long stack leaves


class WrongModelError(Exception):
    """A model differs from its reference by more than its limit."""


def relative(found: Array, expected: Array) -> float:
    """Give the largest difference relative to the largest entry."""
    return float(np.abs(found - expected).max() / np.abs(expected).max())


def against_oracle(modules: int) -> Iterator[Result]:
    """Compare both models with the oracle on a few states of a stack.

    Raises:
        WrongModelError: They differ.
    """
    robot = stack(modules)
    oracle = Oracle(robot.description)
    q, v, a = stack_states(robot, STATES)
    tau = hybridyn.idm(robot, q, v, a)
    found = {"idm": tau, "ddm": hybridyn.ddm(robot, q, v, tau)}
    expected = {
        "idm": np.array([oracle.idm(*state) for state in zip(q, v, a, strict=True)]),
        "ddm": np.array([oracle.ddm(*state) for state in zip(q, v, tau, strict=True)]),
    }
    for model, limit in {"idm": IDM_LIMIT, "ddm": DDM_LIMIT}.items():
        error = relative(found[model], expected[model])
        refuse(error, limit, f"{model} of {modules} modules against the oracle")
        yield Result("gate", "modules", modules, f"{model} against oracle", error, "relative")


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
