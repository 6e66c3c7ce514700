"""Close the rows of a table in a built library: the functions of `c/closing.h`."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass

import numpy as np

from ...spatial import Array
from .cache import Built


@dataclass
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
    """

    def __init__(self, built: Built) -> None:
        """Load a library."""
        self.built = built
        self._rows = ctypes.PyDLL(str(built.path)).closed_rows
        self._rows.restype = ctypes.c_longlong
        self._rows.argtypes = [ctypes.c_longlong, ctypes.c_int, *[ctypes.c_void_p] * 9]

    def follow(
        self,
        at: Place,
        given: tuple[Array, Array, Array],
        out: tuple[Array, Array, Array],
        first: bool,
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
