"""Tasks in processes that another program started, such as the workers of a cluster."""

from __future__ import annotations

import os
import socket
import threading
from collections.abc import Callable
from concurrent.futures import Executor, ThreadPoolExecutor
from functools import partial
from typing import Any

from .. import __version__
from ..errors import HybridynError

#: Held by the task that a process computes: robots and the working directory are its own alone.
_ALONE = threading.Lock()


def started(start: Callable[[], object]) -> Executor:
    """Call the function that returns an executor.

    Raises:
        HybridynError: What it returns is no executor, or runs threads, which would share one robot.
    """
    executor = start()
    name = type(executor).__name__
    if not isinstance(executor, Executor):
        raise HybridynError(f"the executor is of type {name}: return one of `concurrent.futures`")
    if isinstance(executor, ThreadPoolExecutor):
        raise HybridynError(
            f"the executor is of type {name}, whose threads share one robot: return processes"
        )
    return executor


def far(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function that runs elsewhere as it would here: in this folder, by this release, alone."""
    return partial(_called, function, os.getcwd(), __version__)


def _called(function: Callable[..., Any], folder: str, release: str, *task: Any) -> Any:
    """Call a function of a task for a program in a folder.

    Raises:
        HybridynError: This process does not have the folder, or has another release of hybridyn.
    """
    where = f"the process {os.getpid()} on '{socket.gethostname()}'"
    if release != __version__:
        raise HybridynError(f"{where} has hybridyn {__version__}, and the caller {release}: install the same")
    with _ALONE:
        try:
            os.chdir(folder)
        except OSError as error:
            raise HybridynError(
                f"{where} has no folder '{folder}' ({error.strerror}): files lie at the same paths everywhere"
            ) from None
        return function(*task)
