"""Groups of things that are joined, directly or through others (union and find)."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Generic, TypeVar

T = TypeVar("T", int, str)


class Groups(Generic[T]):
    """Groups that `join` makes larger; what was not joined yet is a group of its own."""

    def __init__(self, pairs: Iterable[tuple[T, T]] = ()) -> None:
        """Join the members of each pair."""
        self._above: dict[T, T] = {}
        for one, other in pairs:
            self.join(one, other)

    def of(self, one: T) -> T:
        """Return the member that stands for the group of one."""
        while (above := self._above.setdefault(one, one)) != one:
            self._above[one] = one = self._above[above]  # shortens the way for the next one
        return one

    def join(self, one: T, other: T) -> bool:
        """Join the groups of two, for which the member of the first stands; return False if they are one."""
        first, second = self.of(one), self.of(other)
        self._above[second] = first
        return first != second

    def join_all(self, members: Iterable[T]) -> None:
        """Join several, for which the least of the members that stand for them then stands."""
        standing = sorted({self.of(one) for one in members})
        for other in standing[1:]:
            self.join(standing[0], other)

    def classes(self, members: Iterable[T]) -> list[list[T]]:
        """Return some members group by group, in their order."""
        out: dict[T, list[T]] = {}
        for one in members:
            out.setdefault(self.of(one), []).append(one)
        return list(out.values())
