"""What a quantity is compared with: 113-bit arithmetic, or differences that are extrapolated."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...compiled import exact_model
from ...effects.choice import Effects
from ...spatial import Array
from ...structure.robot import HybridRobot
from ..compare.methods import State, each
from .ways import design_of, differences

#: The same of those that are extrapolated to a step of zero.
EXTRAPOLATED = (4e-4, 2e-4, 1e-4)

#: Least peak of a motor's efforts, relative to the largest of all.
LEAST_PEAK = 1e-6


def exact(quantity: str, robot: HybridRobot, effects: Effects, state: State) -> list[Array]:
    """Compute a quantity in 113-bit arithmetic, rounded at the end, as blocks of shape (T, n).

    Raises:
        HybridynError: The C code cannot be built, or it is not certain of every sample.
        ImportError: CasADi is not installed.
    """
    if quantity == "designs":
        quantity, robot = "idm", robot.with_parameters(design_of(robot))
    return exact_model(quantity, robot, effects, state)


def extrapolated(
    quantity: str, robot: HybridRobot, effects: Effects, state: State
) -> tuple[list[Array], float]:
    """Compute derivatives by central differences, extrapolated to a step of zero.

    Code of derivatives in 113 bits takes minutes to build.

    Returns:
        Blocks of shape (T, motors, motors), and their own error, relative to the largest number of each.
    """
    at, samples = differences(quantity, effects, robot), [*zip(*state, strict=True)]
    coarse, middle, fine = (np.array(each(at({"step": step}), samples)) for step in EXTRAPOLATED)
    less, best = ((4.0 * x - y) / 3.0 for x, y in ((middle, coarse), (fine, middle)))
    found = [*np.moveaxis(best, 1, 0)]
    return found, max(map(off, np.moveaxis(less, 1, 0), found))


def off(found: Array, exact: Array, rows: Any = slice(None), *, efforts: bool = False) -> float:
    """Compare a block with its largest number; efforts each with the peak of its motor.

    A peak is at least a part `LEAST_PEAK` of the largest: below, there is only rounding.
    """
    largest = np.abs(exact).max()
    peak = np.maximum(np.abs(exact).max(axis=0), LEAST_PEAK * largest) if efforts else largest
    error = float((np.abs(found - exact[rows]) / np.where(peak > 0, peak, 1.0)).max(initial=0.0))
    return error if np.isfinite(error) else np.inf


def blocks(found: Any) -> list[Array]:
    """Return a result as a list of arrays."""
    parts = [*found.values()] if isinstance(found, dict) else found
    return [np.asarray(x, dtype=float) for x in (parts if isinstance(parts, tuple | list) else [parts])]
