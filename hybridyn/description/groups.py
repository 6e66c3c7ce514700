"""Groups of things that are joined, directly or through others (union and find)."""

from __future__ import annotations

from collections.abc import Hashable


class Groups:
    """Groups that `join` makes larger; what was not joined yet is a group of its own."""

    def __init__(self) -> None:
        self._above: dict[Hashable, Hashable] = {}

    def of(self, one: Hashable) -> Hashable:
        """Return the member that stands for the group of one."""
        passed = []
        while self._above.setdefault(one, one) != one:
            passed.append(one)
            one = self._above[one]
        self._above.update(dict.fromkeys(passed, one))
        return one

    def join(self, one: Hashable, other: Hashable) -> bool:
        """Join the groups of two; return False if they are one group already."""
        first, second = self.of(one), self.of(other)
        self._above[second] = first
        return first != second
