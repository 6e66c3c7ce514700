"""How much rounding changes results: what two orders of the same arithmetic may differ by."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..spatial import Array
from .failures import difference

#: Allowed difference between two orders of elimination, in multiples of the general path's rounding error, or
#: of what rounding in the file leaves open in redundant loops.
ROUNDINGS = 100

#: Number of random roundings that are tried: in two, terms may round alike, and their difference stays.
DRAWS = 8


def rounded(numbers: Any, random: np.random.Generator) -> Any:
    """Return a number or an array, each entry rounded in its own way."""
    return numbers * (1 + 2.0**-52 * random.uniform(-1.0, 1.0, np.shape(numbers)))


def changes_by_rounding(
    draw: Callable[[np.random.Generator], Sequence[NDArray[Any]]], wanted: Sequence[Array]
) -> Array:
    """Compute `ROUNDINGS` times the relative changes of results by rounding, shape (results, T).

    Args:
        draw: Computes results, shapes (T, ...), from numbers that it rounds.
        wanted: The results.
    """
    random, worst = np.random.default_rng(0), np.zeros((len(wanted), len(wanted[0])))
    for _ in range(DRAWS):
        offs = [difference(x, y) for x, y in zip(draw(random), wanted, strict=True)]
        worst = np.maximum(worst, offs)
    return ROUNDINGS * worst
