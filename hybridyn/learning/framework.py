"""What the models ask of a learning framework."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple


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
