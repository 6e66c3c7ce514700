"""Close rows in a built library: of a table (`c/closing.h`), or of many designs (`c/design_rows.h`)."""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...spatial import Array, Mask
from .cache import Built
from .calls import pool
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


#: Number of designs that a thread takes at once, a multiple of every vector width.
BLOCK = 16


class ClosedDesigns:
    """The library's function, which other threads may call at the same time."""

    def __init__(self, built: Built) -> None:
        library = ctypes.CDLL(str(built.path))
        self._close = library.closed_designs
        self._close.restype = None
        integer, pointer = ctypes.c_longlong, ctypes.c_void_p
        self._close.argtypes = (*[integer] * 3, pointer, integer, *[pointer] * 3, integer, *[pointer] * 8)
        self._room = ctypes.c_longlong.in_dll(library, "designs_work").value

    def close(
        self,
        slots: Array,
        guess: tuple[Array, Array, Array],
        given: tuple[Array, Array, Array],
        out: tuple[Array, Array, Array],
        threads: int = 1,
        *,
        strict: bool = False,
    ) -> Mask:
        """Close rows of each design, one after the other from a guess.

        Args:
            slots: Numbers in the slots, shape (designs, slots).
            guess: Positions of the spanning tree and of platforms, and what is prescribed there, shapes
                (nq,), (platforms,), (n,) for all designs, or with a row for each.
            given: What is prescribed, its rates and accelerations, shapes (T, n) for all designs, or
                (designs, T, n).
            out: Room for q, v, a, shapes (designs, T, nq), (designs, T, nv), (designs, T, nv). Numbers of
                designs that are not certain are no states.
            threads: Number of threads.
            strict: Whether the first row must be on the branch of the guess.

        Returns:
            Designs whose states are certain at every row, shape (designs,).
        """
        designs, rows = out[0].shape[:2]
        slots, *guess_and_given = (np.ascontiguousarray(x, dtype=float) for x in (slots, *guess, *given))
        certain = np.empty(designs)
        (q, p, g_0), levels = (
            [x.ctypes.data for x in arrays] for arrays in (guess_and_given[:3], guess_and_given[3:])
        )
        apart, own = guess_and_given[0].ndim - 1, int(guess_and_given[3].ndim == 3)
        rooms, first = [x.ctypes.data for x in (*out, certain)], g_0 if strict else None

        def run(start: int) -> None:
            """Close the rows of a block of designs."""
            work = np.empty(self._room + 64, np.uint8)
            at = -(-work.ctypes.data // 64) * 64
            stop = min(start + block, designs)
            self._close(start, stop, rows, slots.ctypes.data, apart, q, p, first, own, *levels, *rooms, at)

        block = BLOCK if threads > 1 else max(designs, 1)
        if designs <= block:
            run(0)
        else:
            for _ in pool(threads).map(run, range(0, designs, block)):
                pass
        return certain > 0.0
