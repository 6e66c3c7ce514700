"""Prove that modules cannot reach what is prescribed of their links: the sides of polygons are too short."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...description.groups import Groups
from ...spatial import Array, Index
from ..shortfall import Corner, corner_of, corners_of, join_given, most_lacking
from ..task import Task
from .bodies import CarriedFrame
from .problem import ChainProblem


def chain_shortfall(problem: ChainProblem, parts: tuple[Task, ...], q: Array, samples: Index) -> Array:
    """Compute the length that chain and loops lack in any posture, as far as polygons prove it.

    Args:
        problem: The rows of the chain.
        parts: The tasks of its modules: joints that are given there do not move.
        q: Positions, shape (T, nq), with given joints where they are.
        samples: Index of each into the targets' samples, shape (T,).

    Returns:
        Shape (T,), [m]; zero where nothing is proven.
    """
    motion = problem.tree.sweep(q)
    frames, numbers = problem.frames(motion, samples), _Numbers(problem)
    corners: list[Corner] = []
    for k, part in enumerate(parts):
        join_given(part.problem, part.given, numbers.joining(k))
    for k, (part, one, base) in enumerate(zip(parts, motion.parts, frames.bases, strict=True)):
        own = corners_of(part.problem, one, samples, numbers.group(k))
        corners += [corner.seen(base.R, base.p) for corner in own]
    for relative in problem.relatives:
        link, other = relative.link, relative.other
        bodies = numbers.of(other), numbers.of(link)
        own_corner = corner_of(relative.target, frames.seen(link, other), samples, bodies)
        frame = frames.of(other)
        corners.append(own_corner.seen(frame.R, frame.p))
    return most_lacking(numbers.whole.of(0), corners, len(q), parts[0].tolerance)


class _Numbers:
    """Numbers of the bodies of all parts, 0 for the base of the chain.

    Attributes:
        whole: Groups of bodies that are one.
    """

    def __init__(self, problem: ChainProblem) -> None:
        sizes = [len(tree.joints) + 1 for tree in problem.tree.trees]
        self._first = 1 + np.cumsum([0, *sizes])
        self.whole: Groups[int] = Groups()
        for k, base in enumerate(problem.carried.bases):
            self.whole.join(self._number(base.part, base.body), self._number(k, 0))

    def _number(self, part: int, body: int) -> int:
        return int(self._first[part]) + body if part >= 0 else 0

    def of(self, place: CarriedFrame) -> int:
        """Return the group of the body that carries a frame."""
        return self.whole.of(self._number(place.part, place.body))

    def group(self, part: int) -> Callable[[int], int]:
        """Return the function that gives the group of a body of a part."""
        return lambda body: self.whole.of(self._number(part, body))

    def joining(self, part: int) -> Callable[[int, int], object]:
        """Return the function that joins bodies of a part."""
        return lambda one, other: self.whole.join(self._number(part, one), self._number(part, other))
