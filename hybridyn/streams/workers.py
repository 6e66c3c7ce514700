"""Worker processes for the blocks of a table, newly started: `concurrent.futures` with results in order.

No process with threads or with Pinocchio's memory is forked. Ctrl-C reaches only this process, which ends the
workers; if it dies for any reason, the workers end.
"""

from __future__ import annotations

import os
import pickle
import signal
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import partial
from types import TracebackType
from typing import TYPE_CHECKING, Any, NamedTuple, Self

from ..errors import HybridynError
from .memory import keep_freed_memory

if TYPE_CHECKING:
    from concurrent.futures import Future


class Failure(NamedTuple):
    """The result of a task that raised an error."""

    error: Exception


class Workers:
    """Processes that take tasks and return results in the order of the tasks. A context manager."""

    def __init__(self, count: int) -> None:
        """Start the processes; they import modules while the caller continues.

        Args:
            count: Number of processes, 0 for none.
        """
        self._count, self._text = count, b""
        self._waiting: deque[Future[Any]] = deque()
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

    def __len__(self) -> int:
        return self._count

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if self:
            self._executor.shutdown(cancel_futures=True)
        self._count = 0

    def prepare(self, work: object) -> None:
        """Set the function for the tasks, which every process unpacks once."""
        self._text = pickle.dumps(work, protocol=pickle.HIGHEST_PROTOCOL) if self else b""

    def give(self, arguments: tuple[Any, ...]) -> None:
        """Give a task; there are at most as many tasks as processes."""
        assert len(self._waiting) < len(self)
        with _alive():
            self._waiting.append(self._executor.submit(_called, self._text, arguments))

    def take(self) -> Any:
        """Wait for the result of the oldest task, or its `Failure`.

        Raises:
            HybridynError: A process has ended.
        """
        with _alive():
            return self._waiting.popleft().result()

    def over(self, work: Callable[..., Any], tasks: Iterable[tuple[Any, ...]]) -> Iterator[Any]:
        """Apply a function to tuples of arguments in all processes, and yield the results in order.

        Args:
            work: The function, the same one at every call.

        Raises:
            Exception: The first one that the function raises.
        """
        if not self._text:
            self.prepare(work)
        with _alive():
            for result in self._executor.map(partial(_called, self._text), tasks):
                if isinstance(result, Failure):
                    raise result.error
                yield result


@contextmanager
def _alive() -> Iterator[None]:
    """Say in one line that a process has ended."""
    from concurrent.futures.process import BrokenProcessPool

    try:
        yield
    except BrokenProcessPool:
        raise HybridynError(
            "a worker process ended without a result; if memory ran out, use fewer --jobs"
        ) from None


#: The function of this process's tasks, by its text.
_kept: dict[bytes, Any] = {}


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


def _called(text: bytes, arguments: tuple[Any, ...]) -> Any:
    """Call the function of a text; an error is its `Failure`."""
    if text not in _kept:
        _kept.clear()
        _kept[text] = pickle.loads(text)
    try:
        return _kept[text](*arguments)
    except Exception as error:
        return Failure(error)
