"""Take control steps in a built library: the function of `c/control.h`."""

from __future__ import annotations

import ctypes
from collections.abc import Callable

import numpy as np

from .cache import Built
from .calls import Library
from .closed_rows import ClosedRows
from .direct_calls import function_of


class Control:
    """The efforts of a control step from what the motors do.

    Attributes:
        library: The library, whose program "idm" does not compare the loops.
        at_once: Takes the last posture, positions, rates and accelerations of the motors, and room for q, v,
            a and the efforts. Gives 0 where all are certain, `REFUSED` where the loops are not closed, and
            else 2; None where single calls do not run in C.
    """

    def __init__(self, built: Built, rows: ClosedRows) -> None:
        """Load a library, and let `rows` close the loops."""
        self.library = Library(built)
        self.at_once: Callable[..., int] | None = None
        if self.library.programs["idm"].at_once is not None and rows.close_row is not None:
            held, self._rows = ctypes.PyDLL(str(built.path)), rows
            self.at_once = function_of(held, "control_call", np.array([rows.close_row], np.uintp))
