"""Worker processes, newly started: `concurrent.futures` with results in the order of the tasks.

No process with threads or with Pinocchio's memory is forked. Ctrl-C reaches only this process, which ends the
workers; if it dies for any reason, the workers end.
"""

from __future__ import annotations

import ctypes
import functools
import os
import pickle
import signal
import sys
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

from ..errors import HybridynError

if TYPE_CHECKING:
    from concurrent.futures import Future

#: Tasks that are given to each process at once.
TASKS_EACH = 2
_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3  # glibc's names for mallopt


class Workers:
    """Processes that take tasks and return results in the order of the tasks. A context manager."""

    def __init__(self, count: int) -> None:
        """Start the processes; they import modules while the caller continues.

        Args:
            count: Number of processes; with 0, this process works.
        """
        self.count = count
        if not count:
            return
        from concurrent.futures import ProcessPoolExecutor  # most tables need one process only
        from multiprocessing import get_context

        self._executor = ProcessPoolExecutor(count, get_context("spawn"), _begin)
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # inherited by the processes
        try:
            for _ in range(count):
                self._executor.submit(os.getpid)
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if self.count:
            self._executor.shutdown(cancel_futures=True)

    def over(self, work: Callable[..., Any], tasks: Iterable[tuple[Any, ...]]) -> Iterator[Any]:
        """Apply a function to tuples of arguments, and yield the results in order.

        Args:
            work: The function; a process unpacks it once, as long as it is the same.
            tasks: The arguments; only some are held at once.

        Raises:
            HybridynError: The first error of the function or of `tasks` in the order of the tasks, or a
                process has ended.
        """
        if not self.count:
            for task in tasks:
                yield work(*task)
            return
        text = pickle.dumps(work, protocol=pickle.HIGHEST_PROTOCOL)
        waiting: deque[Future[Any]] = deque()
        for future in self._given(text, tasks):
            waiting.append(future)
            if len(waiting) > TASKS_EACH * self.count:
                yield _result(waiting.popleft())
        yield from map(_result, waiting)

    def _given(self, text: bytes, tasks: Iterable[tuple[Any, ...]]) -> Iterator[Future[Any]]:
        """Give tasks to the processes; an error of a task is the last result, after those before it."""
        from concurrent.futures import BrokenExecutor, Future

        try:
            for task in tasks:
                yield self._executor.submit(_called, text, task)
        except (HybridynError, BrokenExecutor) as error:
            wrong: Future[Any] = Future()
            wrong.set_exception(error)
            yield wrong


def _result(future: Future[Any]) -> Any:
    """Return a result; say in one line that a process has ended."""
    from concurrent.futures import BrokenExecutor

    try:
        return future.result()
    except BrokenExecutor:
        raise HybridynError(
            "a worker process ended without a result; if memory ran out, use fewer --jobs"
        ) from None


def _begin() -> None:
    """Prepare a process: import what its tasks need, and end it when the process that started it ends."""
    from threading import Thread

    Thread(target=_end_with_parent, daemon=True).start()
    keep_freed_memory()
    import hybridyn.assembly.assemble
    import hybridyn.dynamics.direct  # noqa: F401 - imported while the other process still reads the robot


def _end_with_parent() -> None:
    from multiprocessing import connection, parent_process

    parent = parent_process()
    assert parent is not None
    connection.wait([parent.sentinel])
    os._exit(1)


#: Returns the function of a text.
_unpacked = functools.lru_cache(1)(pickle.loads)


def _called(text: bytes, arguments: tuple[Any, ...]) -> Any:
    """Call the function of a text."""
    return _unpacked(text)(*arguments)


def keep_freed_memory() -> None:
    """Make the C library keep freed memory for the next array instead of returning it to the system.

    By default glibc maps new memory for each large array, and half the time of a table is spent on page
    faults. With other C libraries this function does nothing.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None) if sys.platform.startswith("linux") else None
    if mallopt is not None:
        mallopt(_MMAP_THRESHOLD, 2**25)
        mallopt(_TRIM_THRESHOLD, 2**31 - 1)
