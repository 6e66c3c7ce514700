"""Single calls after other memory was touched, as in a controller beside other programs.

Before each call every line of a block of memory is read and written that is larger than the caches; so code
and data of the call come from memory. The same calls in a row are given beside it, and the size of the
library that was compiled for the robot.
"""

from __future__ import annotations

import itertools
import time
from typing import Any

import numpy as np

from benchmarks.accuracy import Effort, States, one_by_one, posed
from benchmarks.methods import MODELS, NotMeasuredError, Solver, written
from benchmarks.peers import methods_of
from benchmarks.peers.ours import COMPILED, compiled
from benchmarks.results import NAN, Row
from benchmarks.scaling import SETTINGS
from benchmarks.timing import Candidate, measured
from hybridyn import HybridRobot

ROBOTS = ("lx4", "five_bar")
#: Who is called; without a closed model of Pinocchio for accelerations given, its projection.
METHODS = (COMPILED, "pin.lcaba", "pin.constraintDynamics", "pin.rnea + projection, dense")
#: Bytes that are touched between two calls, and number of calls.
TOUCHED, CALLS = 40_000_000, 300


def measure(case: str, calls: int = CALLS, touched: int = TOUCHED) -> list[Row]:
    """Measure both models of a robot.

    Args:
        case: The robot.
        calls: Number of cold calls, of which the median is given.
        touched: Bytes that are touched before each.
    """
    block, rows = np.zeros(touched, dtype=np.uint8), []
    for model in MODELS:
        problem = posed(case, model, Effort(judged=2, batches=(2,)))
        for method in methods_of(model):
            if method.name not in METHODS:
                continue
            setting = SETTINGS.get(method.name, {})
            row = Row(case, model, method.name, written(setting))
            try:
                solve = method.prepare(problem.robot)(setting)
            except NotMeasuredError as why:
                rows.append(row._replace(note=str(why)))
                continue
            row = row._replace(
                error=problem.reference.off(np.array([solve(*one) for one in problem.singles]))
            )
            states = itertools.cycle(problem.singles)
            times = [_cold(solve, next(states), block) for _ in range(calls)]
            hot = Candidate(row, len(problem.singles), one_by_one(solve, problem.singles))
            (row,) = measured([hot], 7)
            size = _code(problem.robot) if method.name == COMPILED else NAN
            rows.append(row._replace(median=1e6 * float(np.median(times)), value=size, unit="bytes of code"))
    return rows


def _cold(solve: Solver, state: States, block: Any) -> float:
    """Touch a block of memory, then return the time of a call [s]."""
    block[::64] += 1
    started = time.perf_counter()
    solve(*state)
    return time.perf_counter() - started


def _code(robot: HybridRobot) -> float:
    """Return the size of the file that was compiled for a robot, in bytes; it lies in the cache."""
    _, parts = compiled(robot).__reduce__()
    return float(parts[2].path.stat().st_size)
