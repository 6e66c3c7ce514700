"""Close rows in a built library (`c/closing.h`): of a table, or of many designs."""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable, Sequence

import numpy as np

from ...spatial import Array, Index
from .cache import Built
from .calls import Calls, in_blocks
from .direct_calls import DOUBLE, function_of, knows_arrays, refuse

#: Arrays of three kinds for each row: q, v, a; or what is prescribed with its rates and accelerations. Of a
#: posture: positions of the spanning tree, poses of the platforms, and what is prescribed there.
Rows = tuple[Array, Array, Array]


#: Number of designs that a thread takes at once, a multiple of every vector width.
BLOCK = 16


class ClosedRows:
    """The functions of a library that closes rows, of one robot or of its designs.

    Those for one robot hold the interpreter's lock, which protects their workspace.

    Attributes:
        built: The library's file.
        from_motors: Closes one row from the posture that the last call gave. Takes that posture, positions,
            rates and accelerations of the motors, and room for q, v and a; gives 0 where that is certain.
    """

    def __init__(self, built: Built, *, free: bool) -> None:
        """Load the library.

        Args:
            free: Whether calls release the interpreter's lock: those for designs.
        """
        self.built, self.from_motors = built, refuse
        held, integer, pointer = ctypes.PyDLL(str(built.path)), ctypes.c_longlong, ctypes.c_void_p
        self._held, self._rows = held, (ctypes.CDLL(str(built.path)) if free else held).closed_rows
        self._rows.restype = None
        self._rows.argtypes = [*[integer] * 3, *[pointer] * 4, *[ctypes.c_int] * 3, *[pointer] * 8]
        self._room = integer.in_dll(held, "rows_work").value
        motors = hasattr(held, "close_call")
        if motors and sys.implementation.name == "cpython" and knows_arrays(held, DOUBLE):
            self.from_motors = function_of(held, "close_call")
            self._keep = held.keep_place
            self._keep.argtypes, self._keep.restype = [pointer] * 3, None

    def close(
        self, slots: Array, start: Rows, given: Sequence[Array], out: Sequence[Array], threads: int = 1, *,
        guess: bool = True, strict: bool = False,
    ) -> Index:  # fmt: skip
        """Close rows of each design, one after the other.

        Args:
            slots: Numbers in the slots, shape (designs, slots); (1, 0) for the robot itself.
            start: Positions of the spanning tree and of platforms, and what is prescribed there, shapes
                (nq,), (platforms,), (n,), or (designs, nq) ... if each has its own.
            given: What is prescribed, its rates and accelerations, shapes (T, n), or (designs, T, n).
            out: Room for q, v, a, shapes (designs, T, nq), (designs, T, nv), (designs, T, nv). Numbers of
                rows that are not certain are no states.
            threads: Number of threads.
            guess: Whether the start is a guess, from which Newton's method must reach the first row.
            strict: Whether the first row must be on the branch of the start.

        Returns:
            Number of rows of each design that are certain, shape (designs,).
        """
        (designs, rows), each, own = out[0].shape[:2], start[0].ndim == 2, given[0].ndim == 3
        arrays = [np.ascontiguousarray(x, dtype=float) for x in (slots, *start, *given)]
        certain = np.empty(designs)
        first, *levels = ([x.ctypes.data for x in some] for some in (arrays[:4], arrays[4:], (*out, certain)))
        if not strict:
            first[3] = 0

        def run(at: int, stop: int) -> None:
            """Close the rows of a block of designs."""
            work = np.empty(self._room + 64, np.uint8)
            aligned = -(-work.ctypes.data // 64) * 64
            taken, room = levels
            self._rows(at, stop, rows, *first, guess, each, own, *taken, *room, aligned)

        in_blocks(run, designs, BLOCK, threads)
        return certain.astype(int)

    def control(self, idm: Calls) -> Callable[..., int]:
        """Return the call of a control step: that of `from_motors`, whose room has the efforts at its end.

        It gives 0 where all is certain, `REFUSED` where the loops are not closed, and else 2.
        """
        if self.from_motors is refuse or not idm.address:
            return refuse
        return function_of(self._held, "control_call", np.array([idm.address], np.uintp))

    def keep(self, at: Rows) -> None:
        """Keep a posture from which `from_motors` starts if it is given as the last one."""
        if self.from_motors is not refuse:
            self._keep(*(x.ctypes.data for x in at))
