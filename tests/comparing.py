"""How tests compare numbers, and the tolerances that more than one of them uses."""

from __future__ import annotations

import numpy as np

ROUNDING = 1e-13  # a few hundred operations on numbers of one size
SOLVED = 1e-11  # the same after solving with matrices of condition up to some hundreds


def close_to(actual: np.ndarray, expected: np.ndarray, tolerance: float) -> None:
    """Compare relative to the largest entry."""
    scale = max(np.abs(expected).max(initial=0.0), 1e-300)
    assert np.abs(np.asarray(actual, float) - expected).max(initial=0.0) <= tolerance * scale
