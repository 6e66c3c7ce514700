"""Close rows for many designs in a built library: the function of `c/design_rows.h`."""

from __future__ import annotations

import ctypes

import numpy as np

from ...spatial import Array, Mask
from .cache import Built
from .calls import pool

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
