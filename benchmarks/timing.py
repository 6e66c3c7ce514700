"""Times of many calls in one run, interleaved: what disturbs the machine disturbs all of them. And processes.

A process of its own: none warms or fills the next, a crash or a hang costs one point and not the run.
"""

from __future__ import annotations

import gc
import multiprocessing
import os
import random
import resource
import subprocess
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, NamedTuple

from benchmarks.results import Row

MIB = 2.0**20
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


def interleaved(
    calls: Sequence[Callable[[], object]],
    rounds: int,
    least: float = LEAST,
    *,
    warm: bool = False,
    clock: Clock | None = None,
) -> list[tuple[float, float]]:
    """Time calls in turn, in a new order every round.

    Args:
        calls: What is timed; each is warmed up first.
        rounds: Measurements of each call.
        least: Shortest measurement [s].
        warm: Whether each measurement of repeated calls follows one like it that is not timed, so that all
            cores are awake.
        clock: The clock, None for the wall's; processor time leaves out what others use of a busy machine.

    Returns:
        Least and median time of each call [s].
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
    return [(min(one), sorted(one)[len(one) // 2]) for one in found]


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
        one.row._replace(us=1e6 * shortest / one.samples, median=1e6 * median / one.samples)
        for one, (shortest, median) in zip(candidates, times, strict=True)
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


def in_own_process(task: Callable[..., Any], *arguments: object, patience: float = 3_600.0) -> Any:
    """Run a task in a fresh process; its exceptions come through.

    Args:
        task: A function of a module.
        arguments: Its arguments.
        patience: How long it may take [s].

    Raises:
        NotComparableError: It took too long, or its process died.
    """
    from hybridyn.studies.compare.peer_engine import NotComparableError  # which the process need not import

    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe()
    process = context.Process(target=_child, args=(there, task, *arguments))
    process.start()
    there.close()
    try:
        if not here.poll(patience):
            raise NotComparableError(f"given up after {patience:.0f} s")
        try:
            ok, value = here.recv()
        except EOFError:
            process.join()
            raise NotComparableError(f"its process died (exit status {process.exitcode})") from None
    finally:
        process.kill()
        process.join()
    if not ok:
        raise value
    return value


def _child(there: Connection, task: Callable[..., Any], *arguments: object) -> None:
    """Run a task, send what it gives; die with the process that asked for it."""
    threading.Thread(target=_follow, daemon=True).start()
    try:
        there.send((True, task(*arguments)))
    except Exception as error:
        error.add_note(traceback.format_exc())
        there.send((False, error))


def _follow() -> None:
    """End this process when its parent has ended."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def forget_peak() -> None:
    """Start the peak of `memory` anew, where the system can."""
    with suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")


def memory(name: str) -> float:
    """Return the memory of this process [bytes], NaN where the system does not tell.

    Args:
        name: "VmRSS", what it holds; "VmHWM", the most that it held since `forget_peak`.
    """
    try:
        lines = Path("/proc/self/status").read_text().splitlines()
    except OSError:
        return float("nan")
    return next((1024.0 * float(line.split()[1]) for line in lines if line.startswith(name)), float("nan"))


@contextmanager
def only_cores(count: int) -> Iterator[bool]:
    """Let this process and its children use so many cores; tells whether that could be done."""
    if not hasattr(os, "sched_setaffinity"):
        yield False
        return
    before = os.sched_getaffinity(0)
    chosen = sorted(before)[:count]
    os.sched_setaffinity(0, chosen)
    try:
        yield len(chosen) == count
    finally:
        os.sched_setaffinity(0, before)


def spent(words: Sequence[str], **options: Any) -> tuple[float, float, str]:
    """Run a Python program; return processor time of all its processes, wall time [s], and what it said.

    Raises:
        RuntimeError: It failed.
    """
    before, started = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    done = subprocess.run([sys.executable, *words], capture_output=True, text=True, **options)
    wall, after = time.perf_counter() - started, resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode:
        raise RuntimeError(f"{' '.join(words[-3:])}: {done.stderr.strip()}")
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, wall, done.stdout
