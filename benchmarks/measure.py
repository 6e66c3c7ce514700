"""Time and memory. Every point runs in a process of its own, so that none warms or fills the next."""

from __future__ import annotations

import gc
import multiprocessing
import os
import subprocess
import sys
import tempfile
import time
import tracemalloc
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from pathlib import Path

import hybridyn
from benchmarks.cases import LX4, stack, stack_motion, stack_states, write_long_trajectory
from benchmarks.gate import against_oracle, round_trip
from benchmarks.results import Result

NOT_MEASURED = float("nan")
MIB = 2.0**20

COMMAND = """
import re, sys
from pathlib import Path
from hybridyn.cli import main
status = main(sys.argv[1:])
proc = Path("/proc/self/status")
peak = re.search(r"VmHWM:\\s*(\\d+)", proc.read_text()) if proc.exists() else None
print(peak[1] if peak else "nan")
sys.exit(status)
"""
"""The command line, and then the most memory it ever held [KiB] on standard output."""


def in_own_process(task: Callable[..., list[Result]], *arguments: object) -> list[Result]:
    """Run a task in a fresh process; its exceptions come through."""
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, mp_context=context) as pool:
        return pool.submit(task, *arguments).result()


def gate(modules: int) -> list[Result]:
    """Compare both models with the oracle."""
    return list(against_oracle(modules))


def model_cost(modules: int, samples: int, repeats: int) -> list[Result]:
    """Measure assembly and both models on a stack: time per sample (best of the repeats), memory per sample.

    Memory per sample is the peak of what Python and NumPy allocate during a call, divided by the batch.

    Args:
        modules: Number of modules.
        samples: Samples per call.
        repeats: Number of timed calls.

    Raises:
        WrongModelError: The models do not invert each other.
    """
    stack(1)  # everything is imported
    before = resident()
    robot = stack(modules)
    held = resident() - before
    q, v, a = stack_states(robot, samples)
    error = round_trip(robot, q, v, a)
    tau = hybridyn.idm(robot, q, v, a)
    motion = stack_motion(modules, samples)
    calls: dict[str, Callable[[], object]] = {
        "assemble": lambda: hybridyn.assemble(robot, platforms=motion, guess=q[0]),
        "idm": lambda: hybridyn.idm(robot, q, v, a),
        "ddm": lambda: hybridyn.ddm(robot, q, v, tau),
    }
    results = [
        Result("stack", "modules", modules, "robot", held / MIB, "MiB"),
        Result("stack", "modules", modules, "ddm(idm(a)) against a", error, "relative"),
    ]
    for name, call in calls.items():
        seconds = best_time(call, repeats) / samples
        memory = peak_allocated(call) / samples
        results += [
            Result("stack", "modules", modules, f"{name} time", 1e6 * seconds, "us per sample"),
            Result("stack", "modules", modules, f"{name} memory", memory / 1024.0, "KiB per sample"),
        ]
    return results


def main_job(rows: int, cores: int) -> list[Result]:
    """Measure `hybridyn idm` on the LX4, platform poses to efforts, from the start of the program to its end.

    Args:
        rows: Rows of the table.
        cores: Number of cores that the program may use.

    Raises:
        RuntimeError: The command failed.
    """
    with tempfile.TemporaryDirectory() as folder, only_cores(cores) as given:
        table = Path(folder) / "trajectory.csv"
        write_long_trajectory(table, rows)
        words = ["idm", str(LX4), str(table), "-o", str(Path(folder) / "efforts.csv"), "-q"]
        started = time.perf_counter()
        done = subprocess.run([sys.executable, "-c", COMMAND, *words], capture_output=True, text=True)
        wall = time.perf_counter() - started
    if done.returncode:
        raise RuntimeError(f"hybridyn idm failed: {done.stderr.strip()}")
    case = f"main job on {cores} core{'s' if cores > 1 else ''}"
    return [
        Result(case, "rows", rows, "wall time", wall if given else NOT_MEASURED, "s"),
        Result(case, "rows", rows, "peak memory", float(done.stdout) / 1024.0, "MiB"),
    ]


def best_time(call: Callable[[], object], repeats: int) -> float:
    """Give the shortest of several times, after one call that does not count [s]."""
    call()
    times = []
    gc.disable()
    for _ in range(repeats):
        started = time.perf_counter()
        call()
        times.append(time.perf_counter() - started)
    gc.enable()
    return min(times)


def peak_allocated(call: Callable[[], object]) -> int:
    """Give the peak of what a call allocates through Python and NumPy [bytes]."""
    tracemalloc.start()
    try:
        call()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def resident() -> float:
    """Give the memory that this process holds [bytes], NaN where the system does not tell."""
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
    except OSError:
        return NOT_MEASURED
    return float(pages * os.sysconf("SC_PAGE_SIZE"))


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
