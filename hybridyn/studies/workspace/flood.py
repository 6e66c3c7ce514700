"""The search of a lattice, from a reached pose to neighbours that can be reached."""

from __future__ import annotations

import itertools
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import numpy as np

from ...errors import ModelError
from ...linkage.targets import COORDINATES
from ...spatial import Array, Index
from .closing import OUT_OF_REACH, REACHED, PoseClosing

#: Numbers of parts into which a step to a neighbour is divided, one attempt after the other.
PARTS = (1, 4, 16)
#: Number of poses that are closed at once. It is fixed, so that no result depends on the number of processes.
CHUNK = 256
#: Largest number of poses.
MOST = 200_000
#: Applies one function to tuples of arguments, in order, possibly in other processes.
Spread = Callable[[Callable[..., Any], Iterable[tuple[Any, ...]]], Iterator[Any]]

#: A lattice point: steps from the origin along each axis.
Point = tuple[int, ...]
#: A step from one point to a neighbour.
Pair = tuple[Point, Point]


class Flood:
    """The lattice points that are reached, and the steps that remain to be tried."""

    def __init__(self, close: PoseClosing, start: Array, step: Array, q: Array) -> None:
        """Start at the origin.

        Args:
            close: Steps from poses to neighbouring ones.
            start: Coordinates of the origin, shape (names,), [m, rad].
            step: Step of each swept coordinate, shape (axes,), [m, rad].
            q: Posture of the modules at the origin, shape (their nq,).
        """
        self.close, self.start, self.step = close, start, step
        self.angular = [COORDINATES.index(axis) >= 3 for axis in close.sweep.axes]
        self.reached: dict[Point, Array] = {(0,) * len(step): q}
        self.waiting: dict[Point, list[Point]] = {}
        self.hard: list[list[Pair]] = [[] for _ in PARTS]
        #: Steps that were rejected, by reason.
        self.rejected: dict[str, list[Pair]] = defaultdict(list)

    def values(self, index: Index) -> Array:
        """Return the coordinates of lattice points (n, axes), shape (n, names)."""
        return self.close.sweep.at(self.start, self.step, index)

    def found(self) -> tuple[Index, Array]:
        """Return the reached lattice points, shape (n, axes), sorted, and the modules' postures there."""
        index = np.array(list(self.reached)).reshape(-1, len(self.step))
        order = np.lexsort(index.T[::-1])
        return index[order], np.array(list(self.reached.values()))[order]

    def run(self, spread: Spread, progress: Callable[[int], None] | None) -> None:
        """Find all reachable lattice points.

        Args:
            spread: Distributes the chunks of steps.
            progress: Called with the number of poses reached, or None.

        Raises:
            ModelError: There are too many poses.
        """
        self._queue_neighbours(next(iter(self.reached)))
        while (found := self._next()) is not None:
            level, pairs = found
            done = 0
            for q, state in spread(self.close, self._chunks(level, pairs)):
                for posture, what, pair in zip(q, state, pairs[done : done + len(q)], strict=True):
                    self._record(level, pair, posture, int(what))
                done += len(q)
                if progress:
                    progress(len(self.reached))
            if len(self.reached) > MOST:
                raise ModelError(
                    f"the workspace has more than {MOST:,} poses: take larger steps or fewer coordinates, or "
                    "state limits in the robot's file"
                )

    def _next(self) -> tuple[int, list[Pair]] | None:
        """Return the index in `PARTS` and the steps to try next, or None at the end."""
        if self.waiting:  # one step to each point, from the first neighbour not tried yet
            pairs = [(sides.pop(0), to) for to, sides in self.waiting.items()]
            self.waiting = {to: sides for to, sides in self.waiting.items() if sides}
            return 0, pairs
        for level in range(1, len(PARTS)):
            pairs = [pair for pair in self.hard[level] if pair[1] not in self.reached]
            self.hard[level] = []
            if pairs:
                return level, pairs
        return None

    def _record(self, level: int, pair: Pair, posture: Array, what: int) -> None:
        to = pair[1]
        if to in self.reached:
            return
        if what == REACHED:
            self.reached[to] = posture
            self.waiting.pop(to, None)
            self._queue_neighbours(to)
        elif what == OUT_OF_REACH and level + 1 < len(PARTS):
            self.hard[level + 1].append(pair)
        else:
            self.rejected["reach" if what == OUT_OF_REACH else self.close.names[what]].append(pair)

    def _queue_neighbours(self, at: Point) -> None:
        """Queue the steps from a point to its neighbours."""
        for axis, direction in itertools.product(range(len(at)), (1, -1)):
            to = (*at[:axis], at[axis] + direction, *at[axis + 1 :])
            if self.angular[axis] and abs(to[axis]) * self.step[axis] > np.pi:
                self.rejected["half a turn"].append((at, to))
            elif to not in self.reached:
                self.waiting.setdefault(to, []).append(at)

    def _chunks(self, level: int, pairs: list[Pair]) -> Iterator[tuple[Any, ...]]:
        for i in range(0, len(pairs), CHUNK):
            part = pairs[i : i + CHUNK]
            before, after = (self.values(np.array([pair[side] for pair in part])) for side in (0, 1))
            yield PARTS[level], before, after, np.array([self.reached[at] for at, _ in part])
