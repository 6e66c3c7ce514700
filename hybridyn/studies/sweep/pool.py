"""What every engine gives: processes that call a function of many tasks."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any, Protocol


class WorkerDiedError(Exception):
    """A worker process ended in the middle of its work."""


class Pool(Protocol):
    """Processes that are ready.

    Attributes:
        workers: Their number.
    """

    @property
    def workers(self) -> int:
        """Number of processes."""
        ...

    def run(self, function: Callable[..., Any], tasks: Iterable[Any], *, at_once: int) -> Iterator[Any]:
        """Call a function of each task, and yield the results as they come.

        Raises:
            WorkerDiedError: A process ended; the tasks without a result have to be given again.
        """
        ...
