"""Open a USD file: OpenUSD reads it in a process of its own, which sends its prims as text.

One process serves many files, because importing OpenUSD takes half a second. A file that ends it is an error,
and the next file gets a new one.
"""

from __future__ import annotations

import contextlib
import functools
import importlib.util
import json
import os
import signal
import sys
import threading
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from types import ModuleType
from typing import Any

from ...errors import ModelError, install_advice
from ..files_read import record
from ..urdf.xml_node import LARGEST_FILE
from .stage import Stage
from .worker import begin, read_stage

#: Memory that the process of OpenUSD may take [bytes].
MEMORY = 2 * 2**30

#: Processor time that a file may take [s]; a robot of 10,000 links takes 10 s.
SECONDS = 120

#: Most prims of a file.
MOST_PRIMS = 100_000

_LOCK = threading.Lock()


def open_usd(file: str, package_dirs: Sequence[str | os.PathLike[str]] = ()) -> Stage:
    """Open a USD file with the layers that it names.

    Args:
        file: Path of the file.
        package_dirs: Folders, beside the robot's own, in which layers may be.

    Raises:
        ModelError: usd-core is not installed, OpenUSD refuses the file, the file names layers elsewhere, or
            it takes too much time or memory.
    """
    if importlib.util.find_spec("pxr") is None:
        advice = install_advice("usd")
        raise ModelError(f"this is USD, for which hybridyn needs the package usd-core; {advice}", file=file)
    path = os.path.abspath(file)
    own = {os.path.dirname(path), os.path.dirname(os.path.realpath(path))}
    folders = sorted(os.path.realpath(folder) for folder in (*own, *package_dirs))
    with _LOCK:
        text = _prims(path, folders, file)
    record(f"{path}/stage", text)  # with all layers, which only OpenUSD reads
    answer: dict[str, Any] = json.loads(text)
    if "error" in answer:
        inner = answer["file"]
        where = file if inner in (None, path) or not os.path.exists(inner) else os.path.relpath(inner)
        raise ModelError(str(answer["error"]), file=where, line=answer["line"])
    return Stage(file, answer)


def _prims(path: str, folders: list[str], file: str) -> bytes:
    """Return the prims of a file as text."""
    for _ in range(2):  # the process may have ended before, while it waited
        try:
            pool, process = _started(os.getpid())
        except (OSError, AssertionError, BrokenProcessPool) as error:
            raise ModelError(f"USD: no process could be started for OpenUSD: {error}", file=file) from None
        try:
            return pool.submit(read_stage, path, folders, LARGEST_FILE, MOST_PRIMS, SECONDS).result()
        except BrokenProcessPool:
            _started.cache_clear()
        except BaseException:  # interrupted: its answer must not be waited for
            _started.cache_clear()
            with contextlib.suppress(ProcessLookupError):
                os.kill(process, signal.SIGKILL)
            raise
    raise ModelError(
        "OpenUSD ended while it read the file; the file is damaged, or needs more than "
        f"{SECONDS} s of processor time or {MEMORY // 2**30} GiB of memory",
        file=file,
    )


@functools.cache
def _started(process: int) -> tuple[ProcessPoolExecutor, int]:
    """Start the process of OpenUSD.

    Args:
        process: Number of this process; a fork of it starts its own.

    Returns:
        The executor that asks it, and its number.
    """
    pool = ProcessPoolExecutor(1, get_context("spawn"), begin, (MEMORY,))
    main = sys.modules["__main__"]
    sys.modules["__main__"] = ModuleType("__main__")  # or the process would run the caller's script again
    try:
        answer = pool.submit(os.getpid)
    finally:
        sys.modules["__main__"] = main
    return pool, answer.result()
