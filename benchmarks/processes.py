"""Processes of their own: none warms or fills the next, a crash or a hang costs one point and not the run."""

from __future__ import annotations

import multiprocessing
import os
import threading
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from benchmarks.methods import NotMeasuredError

MIB = 2.0**20


def in_own_process(task: Callable[..., Any], *arguments: object, patience: float = 3_600.0) -> Any:
    """Run a task in a fresh process; its exceptions come through.

    Args:
        task: A function of a module.
        arguments: Its arguments.
        patience: How long it may take [s].

    Raises:
        NotMeasuredError: It took too long, or its process died.
    """
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe()
    process = context.Process(target=_child, args=(there, task, *arguments))
    process.start()
    there.close()
    try:
        if not here.poll(patience):
            raise NotMeasuredError(f"given up after {patience:.0f} s")
        try:
            ok, value = here.recv()
        except EOFError:
            process.join()
            raise NotMeasuredError(f"its process died (exit status {process.exitcode})") from None
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


def resident() -> float:
    """Return the memory that this process holds [bytes], NaN where the system does not tell."""
    return _status("VmRSS")


def peak() -> float:
    """Return the most memory that this process held since `forget_peak` [bytes], NaN where nobody tells."""
    return _status("VmHWM")


def forget_peak() -> None:
    """Start `peak` anew, where the system can."""
    with suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")


def _status(name: str) -> float:
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
