"""What comparisons of drawn mechanisms find."""

from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from hybridyn.compiled.failures import difference

SOLVED = 1e-8  # solved with rows of condition up to some thousands, which nothing guards in the oracle
CLOSED = 1e-11  # largest residual [m, rad]


@dataclass
class Found:
    """What was compared: worst errors of models and derivatives, how many of each, and what is wrong."""

    worst: dict[str, float] = field(default_factory=dict)
    count: Counter[str] = field(default_factory=Counter)
    wrong: list[str] = field(default_factory=list)

    def add(self, what: str, case: str, off: float, limit: float) -> None:
        """Add a comparison."""
        self.worst[what] = float(np.nanmax([self.worst.get(what, 0.0), off]))
        self.count[what] += 1
        if not off <= limit:
            self.wrong.append(f"{case}: {what} {off:.1e}")

    def compare(self, what: str, case: str, found: np.ndarray, right: np.ndarray, limit: float) -> None:
        """Add a comparison of two arrays, relative to the largest entry of the second."""
        self.add(what, case, float(difference(found.reshape(1, -1), right.reshape(1, -1))[0]), limit)
