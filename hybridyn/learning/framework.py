"""What the models ask of a learning framework."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..errors import TrajectoryError


class Framework(NamedTuple):
    """A learning framework.

    Attributes:
        xp: Its functions on arrays, with the names of NumPy.
        array: Returns an argument as an array in double precision: its name, the argument, its width.
        still: The same of an argument that carries no gradient.
        constant: Returns an array without its derivatives.
        found: Computes an array without derivatives: a function of NumPy arrays, shape (T, n), that returns
            such an array, its width, and the function's arguments, shapes (..., n).
        apply: Computes a `SmoothFunction` from postures without derivatives and three arrays, shapes
            (..., n).
    """

    xp: Any
    array: Callable[[str, Any, int], Any]
    still: Callable[[str, Any, int], Any]
    constant: Callable[[Any], Any]
    found: Callable[..., Any]
    apply: Callable[..., Any]


def check_width(name: str, given: Any, width: int) -> None:
    """Check the last axis of an array.

    Raises:
        TrajectoryError: It has another width.
    """
    if not given.ndim or given.shape[-1] != width:
        raise TrajectoryError(f"{name} has shape {tuple(given.shape)}; wanted (..., {width})")


def leading_axes(given: Sequence[Any]) -> tuple[int, ...]:
    """Return the axes to which those of arrays before their last ones are broadcast.

    Raises:
        TrajectoryError: They cannot be.
    """
    try:
        return np.broadcast_shapes(*(x.shape[:-1] for x in given))
    except ValueError:
        shapes = ", ".join(str(tuple(x.shape)) for x in given)
        raise TrajectoryError(f"leading axes do not fit each other: shapes {shapes}") from None
