"""Samples that each start from their own posture, closed in C: one in each lane, blocks on threads."""

from __future__ import annotations

import numpy as np

from ....assembly.requests import Requests
from ....spatial import Array, Index
from ....structure.parameters.chosen import Parameters
from ....structure.robot import HybridRobot
from ...library.closed_rows import BLOCK, Rows
from .closing_library import starts_of
from .libraries import ClosingLibraries


class Apart:
    """Closes samples of one robot that do not follow each other."""

    def __init__(self, robot: HybridRobot) -> None:
        """Start without any library: each is built when requests need it."""
        self._robot = robot
        self._libraries = ClosingLibraries(robot, Parameters(robot.description, ()))

    def close(self, requests: Requests, starts: Array, threads: int) -> tuple[Rows, Index]:
        """Close the loops of requests without poses, straight from closed postures on their branches.

        Args:
            requests: The requests, of T samples.
            starts: A posture for each, shape (T, nq).
            threads: Number of threads.

        Returns:
            q, v, a, shapes (T, n), and the samples of which C is not certain, whose numbers are no states:
            all where they fill no block, or there is no library.
        """
        robot, T = self._robot, len(starts)
        out = np.empty((T, robot.nq)), np.empty((T, robot.nv)), np.empty((T, robot.nv))
        asked = self._libraries.asked(requests) if requests.samples == T >= BLOCK else None
        if asked is None:
            return out, np.arange(T)
        closing, given = asked
        places, closed = starts_of(closing.parts, starts)
        rows, room = ([x[:, None] for x in some] for some in (given, out))
        count = closing.rows.close(np.zeros((T, 0)), places, rows, room, threads, strict=True)
        return out, np.flatnonzero((closed * count) < 1)
