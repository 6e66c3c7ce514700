"""Times of many calls in one run: interleaved, so that what disturbs the machine disturbs all of them."""

from __future__ import annotations

import gc
import os
import random
import time
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from benchmarks.results import Row

#: A measurement repeats a call until it takes this long [s].
LEAST = 2e-3
#: Calls in a row.
MOST = 100_000
ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")

#: A clock that counts seconds.
Clock = Callable[[], float]


class Candidate(NamedTuple):
    """What is known of a call before it is timed, as a row; its samples, and the call."""

    row: Row
    samples: int
    call: Callable[[], object]


class Time(NamedTuple):
    """Time per call over the rounds.

    Attributes:
        least, median: [s].
    """

    least: float
    median: float


def interleaved(
    calls: Sequence[Callable[[], object]],
    rounds: int,
    least: float = LEAST,
    *,
    warm: bool = False,
    clock: Clock | None = None,
) -> list[Time]:
    """Time calls in turn, in a new order every round.

    Args:
        calls: What is timed; each is warmed up first.
        rounds: Measurements of each call.
        least: Shortest measurement [s].
        warm: Whether each measurement of repeated calls follows one like it that is not timed, so that all
            cores are awake.
        clock: The clock, None for the wall's; processor time leaves out what others use of a busy machine.

    Returns:
        Least and median time of each call.
    """
    repeats = [_repeats(call, least) for call in calls]
    order, found = list(range(len(calls))), [[0.0] * rounds for _ in calls]
    shuffled = random.Random(0)
    was_on = gc.isenabled()
    gc.disable()
    try:
        for turn in range(rounds):
            shuffled.shuffle(order)
            for i in order:
                if warm and repeats[i] > 1:
                    timed(calls[i], repeats[i], clock)
                found[i][turn] = timed(calls[i], repeats[i], clock)
    finally:
        if was_on:
            gc.enable()
    return [Time(min(one), sorted(one)[len(one) // 2]) for one in found]


def measured(candidates: Sequence[Candidate], rounds: int, least: float = LEAST, **options: Any) -> list[Row]:
    """Time some calls, interleaved; give their rows with times per sample.

    Args:
        candidates: The calls.
        rounds: Measurements of each.
        least: Shortest measurement [s].
        options: As `interleaved` takes them.
    """
    times = interleaved([one.call for one in candidates], rounds, least, **options)
    return [
        one.row._replace(us=1e6 * time.least / one.samples, median=1e6 * time.median / one.samples)
        for one, time in zip(candidates, times, strict=True)
    ]


def timed(call: Callable[[], object], repeats: int, clock: Clock | None = None) -> float:
    """Return the time of one of some calls in a row [s]."""
    clock = clock or time.perf_counter
    started = clock()
    for _ in range(repeats):
        call()
    return (clock() - started) / repeats


def _repeats(call: Callable[[], object], least: float) -> int:
    """Warm a call up; give how often it must run to take so long."""
    call()
    repeats = 1
    while repeats < MOST and (taken := repeats * timed(call, repeats)) < least:
        repeats = min(MOST, max(2 * repeats, int(repeats * least / max(taken, 1e-9)) + 1))
    return repeats


def one_thread() -> None:
    """Pin the threads of linear algebra to one, for processes started from here."""
    for name in ONE_THREAD:
        os.environ[name] = "1"
