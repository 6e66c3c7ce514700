"""Close the rows of a table in a built library: the functions of `c/closing.h`."""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...spatial import Array
from .cache import Built
from .direct_calls import DOUBLE, REFUSED, function_of, knows_arrays


@dataclass(eq=False)
class Place:
    """A closed posture from which rows are followed.

    Attributes:
        q: Positions of the spanning tree, shape (nq,).
        p: Poses of the platforms, shape (7 platforms,).
        g: What is prescribed there, shape (given numbers,).
    """

    q: Array
    p: Array
    g: Array


class ClosedRows:
    """The library's functions. They hold the interpreter's lock, which protects their workspace.

    Attributes:
        built: The library's file.
        from_motors: Closes one row from the posture that the last call gave. Takes that posture, positions,
            rates and accelerations of the motors, and room for q, v and a; gives 0 where that is certain.
        close_row: Address of the same for other libraries; None if rows are not closed from motors.
    """

    def __init__(self, built: Built) -> None:
        self.built = built
        held = ctypes.PyDLL(str(built.path))
        self._rows = held.closed_rows
        self._rows.restype = ctypes.c_longlong
        self._rows.argtypes = [ctypes.c_longlong, ctypes.c_int, *[ctypes.c_void_p] * 9]
        self.from_motors: Callable[..., int] = _refuse
        self.close_row: int | None = None
        motors = hasattr(held, "close_call")
        if motors and sys.implementation.name == "cpython" and knows_arrays(held, DOUBLE):
            self.from_motors = function_of(held, "close_call")
            self.close_row = ctypes.cast(held.close_row, ctypes.c_void_p).value
            self._keep = held.keep_place
            self._keep.argtypes, self._keep.restype = [ctypes.c_void_p] * 3, None

    def keep(self, at: Place) -> None:
        """Keep a posture from which `from_motors` starts if it is given as the last one."""
        if self.from_motors is not _refuse:
            self._keep(at.q.ctypes.data, at.p.ctypes.data, at.g.ctypes.data)

    def follow(
        self, at: Place, given: tuple[Array, Array, Array], out: tuple[Array, Array, Array], first: bool
    ) -> int:
        """Close rows on the branch of a posture, as far as that is certain.

        Args:
            at: The posture, which becomes that of the last row that was closed.
            given: What is prescribed, its rates and accelerations, shapes (T, given numbers), (T, rates).
            out: Room for q, v, a of the rows, shapes (T, nq), (T, nv), (T, nv).
            first: Whether the posture is a guess, not the row before.

        Returns:
            Number of rows that were closed.
        """
        arrays = (*(np.ascontiguousarray(x, dtype=float) for x in given), at.q, at.p, at.g, *out)
        return int(self._rows(len(out[0]), first, *(x.ctypes.data for x in arrays)))


def _refuse(*_: object) -> int:
    """Refuse every row; stands for the C call of a library that closes no rows from motors."""
    return REFUSED
