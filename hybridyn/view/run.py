"""Data of a displayed motion: postures and efforts over time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..spatial import Array

#: Largest number of samples that are kept. A screen shows fewer frames per minute.
MOST = 6000


@dataclass(frozen=True, eq=False)
class ShownMotion:
    """A motion.

    Attributes:
        time: Times, shape (T,), [s], or row numbers if the table has no times.
        q: Postures, shape (T, nq).
        tau: Efforts, shape (T, motors), [N or N m], or None.
        origin: Source of the efforts, or the reason why there are none.
        timed: Whether `time` holds times.
    """

    time: Array
    q: Array
    tau: Array | None
    origin: str
    timed: bool = True

    def index(self, time: float) -> int:
        """Return the sample nearest to a time."""
        after = int(np.searchsorted(self.time, time))
        if after == 0:
            return 0
        if after == len(self.time):
            return after - 1
        return after if self.time[after] - time < time - self.time[after - 1] else after - 1

    @property
    def end(self) -> float:
        """The last time [s] or row number."""
        return float(self.time[-1])

    @property
    def begin(self) -> float:
        """The first time [s] or row number."""
        return float(self.time[0])
