"""The one way a hard case states its claim: a measured number, its bound, and where the bound comes from."""

import json
import math
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

#: The general claims: backward error per module, forward error per condition number.
EPS = float(np.finfo(float).eps)
BACKWARD, FORWARD = 1e-13, 100 * EPS


def apart(actual: np.ndarray, expected: np.ndarray) -> float:
    """Return the largest difference relative to the largest entry."""
    largest = max(np.abs(expected).max(initial=0.0), 1e-300)
    return float(np.abs(actual - expected).max(initial=0.0) / largest)


#: What the fixture gives: it holds a measured number of a quantity of a case to its bound.
Claim = Callable[[str, str, float, float], None]


@pytest.fixture
def claim(request: pytest.FixtureRequest) -> Claim:
    """Hold a number to its bound, and write both down for the table of `python -m benchmarks --hard`.

    `claim(case, quantity, measured, bound)`: the robot and posture in words, what is measured ("backward
    error of ddm"), the worst number found, the bound. The reason of the bound stands in the test's docstring.
    """

    def held(case: str, quantity: str, measured: float, bound: float) -> None:
        measured, bound = float(measured), float(bound)
        record(
            {
                "test": request.node.nodeid,
                "case": case,
                "quantity": quantity,
                "measured": measured,
                "bound": bound,
            }
        )
        assert math.isfinite(measured), f"{case}: {quantity} is {measured}"
        assert measured <= bound, f"{case}: {quantity} is {measured:.3e}, claimed at most {bound:.3e}"

    return held


def record(row: dict[str, str | float]) -> None:
    """Append a row to the file that HYBRIDYN_CLAIMS names, if any, in one write (processes share it)."""
    path = os.environ.get("HYBRIDYN_CLAIMS")
    if path:
        with Path(path).open("a") as file:
            file.write(json.dumps(row) + "\n")
