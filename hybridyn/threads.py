"""Limit BLAS to one thread: from fifty columns on it starts several, which mostly wait for each other."""

from __future__ import annotations

import functools
import os
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from threading import Lock
from typing import Any

#: Environment variables that BLAS libraries read when they are loaded.
VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


#: The limits of the blocks that are running, the oldest first: it knows the numbers that the program had set.
_open: list[Any] = []
_opening = Lock()


@contextmanager
def one_thread() -> Iterator[None]:
    """Keep BLAS to one thread inside a `with` block, or inside a function with `@one_thread()`.

    Afterwards the numbers of threads are those that the calling program had set. They belong to the process:
    where blocks of several threads overlap, the last one to end restores them.
    """
    controller = _controller()
    if controller is None:
        yield
        return
    with _opening:
        _open.append(controller.limit(limits=1))
    try:
        yield
    finally:
        with _opening:
            if len(_open) == 1:
                _open[0].restore_original_limits()
            _open.pop()


def start_none() -> None:
    """Let BLAS libraries that are not loaded yet start no threads, unless the environment says how many.

    If NumPy is not imported yet, this avoids the import of threadpoolctl and the threads.
    """
    for name in VARIABLES:
        os.environ.setdefault(name, "1")


@functools.cache
def _controller() -> Any:
    """Find the BLAS libraries of this process; None where none has more than one thread."""
    if all(os.environ.get(name) == "1" for name in VARIABLES):
        return None
    try:
        module = import_module("threadpoolctl")
    except ImportError:  # installed without dependencies: the same numbers, slower
        return None
    return module.ThreadpoolController().select(user_api="blas")
