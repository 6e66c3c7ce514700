"""Groups of things that are joined, directly or through others (union and find)."""

from __future__ import annotations

from collections.abc import Hashable
from typing import Generic, TypeVar

T = TypeVar("T", bound=Hashable)


class Groups(Generic[T]):
    """Groups that `join` makes larger; what was not joined yet is a group of its own."""

    def __init__(self) -> None:
        self._above: dict[T, T] = {}

    def of(self, one: T) -> T:
        """Return the member that stands for the group of one."""
        passed = []
        while self._above.setdefault(one, one) != one:
            passed.append(one)
            one = self._above[one]
        self._above.update(dict.fromkeys(passed, one))
        return one

    def join(self, one: T, other: T) -> bool:
        """Join the groups of two, for which the member of the first stands; return False if they are one."""
        first, second = self.of(one), self.of(other)
        self._above[second] = first
        return first != second
