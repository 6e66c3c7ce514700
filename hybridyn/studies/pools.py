"""Other processes: any executor of `concurrent.futures` (loky, Dask's), with one rule for deaths."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Executor, Future, wait
from dataclasses import dataclass
from functools import partial
from itertools import islice
from typing import Any

from ..errors import HybridynError, install_advice
from .far_processes import far, started

#: Tasks per process that are given in advance.
AHEAD = 2
#: Times that a task may end its process before it counts as lost.
MOST_DEATHS = 2
#: Name of Dask's error for a process that ended; those of `concurrent.futures` are `BrokenExecutor`.
OF_DASK = "KilledWorker"

Task = tuple[Any, ...]


@dataclass
class Pool:
    """Processes behind an executor.

    Attributes:
        workers: Their number.
        start: Returns the executor; after the death of a process, another one where that is needed.
        deaths: Times that a process died.
        foreign: Whether another program started the processes, in a folder of its own.
    """

    workers: int
    start: Callable[[], Executor]
    deaths: int = 0
    foreign: bool = False

    def run(
        self, function: Callable[..., Any], tasks: Iterable[Task], lost: Callable[..., Any],
        parts: Callable[[Task], list[Task]] = lambda task: [task],
    ) -> Iterator[Any]:  # fmt: skip
        """Call a function with the arguments of each task, and yield the results as they come.

        After the death of a process, the tasks that had been given are called alone: whole, then in parts.

        Args:
            lost: Called with a task that ended its process each time; returns its result.
            parts: Divides a task.
        """
        source, given = iter(tasks), list[Task]()
        function = far(function) if self.foreign else function
        while not (yield from self._survived(function, source, given)):
            for task in given:
                pieces = parts(task)
                if len(pieces) == 1 or not (yield from self._survived(function, iter([task]), [])):
                    yield from self._one_by_one(function, pieces, lost)
            given.clear()

    def _one_by_one(
        self, function: Callable[..., Any], tasks: list[Task], lost: Callable[..., Any]
    ) -> Iterator[Any]:
        for task in tasks:
            for _ in range(MOST_DEATHS):
                if (yield from self._survived(function, iter([task]), [])):
                    break
            else:
                yield lost(*task)

    def _survived(self, function: Callable[..., Any], source: Iterator[Task], given: list[Task]) -> Any:
        """Yield the results of tasks, and return whether no process died; `given` has no result then."""
        executor, tasks = started(self.start), dict[Future[Any], Task]()
        try:
            while True:
                for task in islice(source, (AHEAD * self.workers if self.workers > 1 else 1) - len(tasks)):
                    given.append(task)
                    tasks[executor.submit(function, *task)] = task
                if not tasks:
                    return True
                for future in wait(tasks, return_when=FIRST_COMPLETED).done:
                    result = future.result()
                    given.remove(tasks.pop(future))
                    yield result
        except CancelledError:
            raise HybridynError(
                "the executor cancelled its tasks, as Dask does when its scheduler has gone: start it again, "
                "and continue with resume=True"
            ) from None
        except Exception as error:
            if not isinstance(error, BrokenExecutor) and type(error).__name__ != OF_DASK:
                raise
            self.deaths += 1
            return False
        finally:
            for future in tasks:
                future.cancel()


class ThisProcess(Executor):
    """Calls functions in this process."""

    def submit(self, function: Callable[..., Any], /, *task: Any, **words: Any) -> Future[Any]:
        """Call a function at once."""
        future: Future[Any] = Future()
        future.set_result(function(*task, **words))
        return future


def open_pool(jobs: int | None = None, executor: Callable[[], Executor] | None = None) -> Pool:
    """Return processes: those of an executor, or loky's on this machine.

    Args:
        jobs: Their number; one per core by default.
        executor: Returns an executor; called again after the death of a process.

    Raises:
        HybridynError: joblib, which brings loky, is missing.
    """
    jobs = jobs or cores()
    if executor is not None or jobs == 1:
        return Pool(jobs, executor or ThisProcess, foreign=executor is not None)
    try:
        from joblib.externals.loky import get_reusable_executor
    except ImportError:
        raise HybridynError(f"this needs joblib: {install_advice('sweep')}") from None
    # Processes that began in another folder are started anew.
    words: Any = {"max_workers": jobs, "initializer": os.chdir, "initargs": (os.getcwd(),)}
    return Pool(jobs, partial(get_reusable_executor, **words))


def cores() -> int:
    """Return the number of processor cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
