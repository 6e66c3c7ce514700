"""Close rows in a built library (`c/closing.h`): of a table, or of many designs."""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...spatial import Array, Index
from .cache import Built
from .calls import Calls, pool
from .direct_calls import DOUBLE, function_of, knows_arrays, refuse

#: Arrays of three kinds for each row: q, v, a; or what is prescribed with its rates and accelerations.
Rows = tuple[Array, Array, Array]


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


#: Number of designs that a thread takes at once, a multiple of every vector width.
BLOCK = 16


class ClosedDesigns:
    """The library's function for many designs, which other threads may call at the same time."""

    def __init__(self, built: Built, library: ctypes.CDLL | None = None) -> None:
        self.built, library = built, library or ctypes.CDLL(str(built.path))
        self._rows = library.closed_rows
        self._rows.restype = None
        integer, pointer = ctypes.c_longlong, ctypes.c_void_p
        self._rows.argtypes = [integer] * 3
        self._rows.argtypes += [pointer, integer, *[pointer] * 3, ctypes.c_int, integer, *[pointer] * 8]
        self._room = ctypes.c_longlong.in_dll(library, "rows_work").value

    def close(
        self,
        slots: Array,
        start: Rows,
        given: Rows,
        out: Rows,
        threads: int = 1,
        *,
        guess: bool = True,
        strict: bool = False,
    ) -> Index:
        """Close rows of each design, one after the other.

        Args:
            slots: Numbers in the slots, shape (designs, slots).
            start: Positions of the spanning tree and of platforms, and what is prescribed there, shapes
                (nq,), (platforms,), (n,) for all designs, or with a row for each.
            given: What is prescribed, its rates and accelerations, shapes (T, n) for all designs, or
                (designs, T, n).
            out: Room for q, v, a, shapes (designs, T, nq), (designs, T, nv), (designs, T, nv). Numbers of
                rows that are not certain are no states.
            threads: Number of threads.
            guess: Whether the start is a guess, from which Newton's method must reach the first row.
            strict: Whether the first row must be on the branch of the start.

        Returns:
            Number of rows of each design that are certain, shape (designs,).
        """
        designs, rows = out[0].shape[:2]
        slots, *start_and_given = (np.ascontiguousarray(x, dtype=float) for x in (slots, *start, *given))
        certain = np.empty(designs)
        (q, p, g_0), levels = (
            [x.ctypes.data for x in arrays] for arrays in (start_and_given[:3], start_and_given[3:])
        )
        apart, own = start_and_given[0].ndim - 1, int(start_and_given[3].ndim == 3)
        rooms, first = [x.ctypes.data for x in (*out, certain)], g_0 if strict else None

        def run(at: int) -> None:
            """Close the rows of a block of designs."""
            work = np.empty(self._room + 64, np.uint8)
            aligned = -(-work.ctypes.data // 64) * 64
            stop, places = min(at + block, designs), (slots.ctypes.data, apart, q, p, first)
            self._rows(at, stop, rows, *places, guess, own, *levels, *rooms, aligned)

        block = BLOCK if threads > 1 else max(designs, 1)
        if designs <= block:
            run(0)
        else:
            for _ in pool(threads).map(run, range(0, designs, block)):
                pass
        return certain.astype(int)


class ClosedRows(ClosedDesigns):
    """The functions for rows of one robot. They hold the interpreter's lock, which protects their workspace.

    Attributes:
        built: The library's file.
        from_motors: Closes one row from the posture that the last call gave. Takes that posture, positions,
            rates and accelerations of the motors, and room for q, v and a; gives 0 where that is certain.
    """

    def __init__(self, built: Built) -> None:
        held = self._held = ctypes.PyDLL(str(built.path))
        super().__init__(built, held)
        self.from_motors: Callable[..., int] = refuse
        motors = hasattr(held, "close_call")
        if motors and sys.implementation.name == "cpython" and knows_arrays(held, DOUBLE):
            self.from_motors = function_of(held, "close_call")
            self._keep = held.keep_place
            self._keep.argtypes, self._keep.restype = [ctypes.c_void_p] * 3, None

    def control(self, idm: Calls) -> Callable[..., int]:
        """Return the call of a control step: that of `from_motors`, whose room has the efforts at its end.

        It gives 0 where all is certain, `REFUSED` where the loops are not closed, and else 2.
        """
        if self.from_motors is refuse or not idm.address:
            return refuse
        return function_of(self._held, "control_call", np.array([idm.address], np.uintp))

    def keep(self, at: Place) -> None:
        """Keep a posture from which `from_motors` starts if it is given as the last one."""
        if self.from_motors is not refuse:
            self._keep(at.q.ctypes.data, at.p.ctypes.data, at.g.ctypes.data)

    def follow(self, at: Place, given: Rows, out: Rows, guess: bool) -> int:
        """Return how many rows are closed on the branch of a posture, as far as that is certain.

        Args:
            at: The posture.
            given: What is prescribed, its rates and accelerations, shapes (T, given numbers), (T, rates).
            out: Room for q, v, a of the rows, shapes (T, nq), (T, nv), (T, nv).
            guess: Whether the posture is a guess, not the row before.
        """
        q, v, a = out
        room = q[None], v[None], a[None]
        found = self.close(np.zeros((1, 0)), (at.q, at.p, at.g), given, room, guess=guess, strict=True)
        return int(found[0])
