"""Samples that compiled models hand over to the general path: their number, and what is said of it."""

from __future__ import annotations

import logging
from collections import Counter

log = logging.getLogger("hybridyn.compiled")


class HandedOver:
    """The samples of one compiled robot that the general path has computed.

    Attributes:
        counts: Their number, by call and reason.
    """

    def __init__(self, name: str) -> None:
        """Count from zero, for a robot of this name."""
        self._name, self._tables = name, set[str]()
        self.counts: Counter[str] = Counter()

    def hand_over(self, call: str, count: int, why: str = "") -> None:
        """Count samples that the general path computes."""
        if count:
            self.counts[f"{call} ({why})" if why else call] += count

    def say_of_table(self, call: str, count: int, samples: int) -> None:
        """Log how many samples the general path computes; warn where they are most of the first table."""
        first = samples > 1 and call not in self._tables
        if first:
            self._tables.add(call)
        if count:
            log.log(
                logging.WARNING if first and 2 * count > samples else logging.INFO,
                "robot '%s', %s: %d of %d samples computed by the general path",
                self._name, call, count, samples,
            )  # fmt: skip
