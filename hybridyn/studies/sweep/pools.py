"""Other processes: any executor of `concurrent.futures` (loky, Dask, Ray), with one rule for deaths."""

from __future__ import annotations

import contextlib
import os
import re
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from itertools import islice
from typing import Any, Literal

from ...errors import HybridynError, install_advice

PoolName = Literal["loky", "dask", "ray"]
#: The package of each pool, and the extra that brings it.
PACKAGES = {"loky": ("joblib", "sweep"), "dask": ("distributed", "dask"), "ray": ("ray", "ray")}
#: Address of a scheduler by pool, and an example.
ADDRESSES = {
    "dask": (re.compile(r"(tcp|tls|ucx|wss?)://\S+:\d+(/\S*)?"), "tcp://host:8786"),
    "ray": (re.compile(r"(ray://)?[^\s:/]+:\d+|auto"), "host:6379"),
}
#: Tasks per process that are given in advance.
AHEAD = 2
#: Times that a task may end its process before it counts as lost.
MOST_DEATHS = 2

Task = tuple[Any, ...]


@dataclass
class Pool:
    """Processes behind an executor.

    Attributes:
        workers: Their number.
        start: Returns the executor; after the death of a process, another one where that is needed.
        died: Errors of tasks whose process is gone.
        deaths: Times that a process died.
    """

    workers: int
    start: Callable[[], Executor]
    died: tuple[type[BaseException], ...] = (BrokenExecutor,)
    deaths: int = 0

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
        executor, tasks = self.start(), dict[Future[Any], Task]()
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
        except self.died:
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
        try:
            future.set_result(function(*task, **words))
        except Exception as error:
            future.set_exception(error)
        return future


@contextlib.contextmanager
def open_pool(pool: PoolName, jobs: int | None, scheduler: str | None) -> Iterator[Pool]:
    """Start processes, or connect to a cluster.

    Args:
        pool: "loky", "dask" or "ray".
        jobs: Number of processes; one per core by default. A cluster has its own number.
        scheduler: Address of a running cluster: of Dask, "tcp://host:8786", or of Ray, "host:6379".

    Raises:
        HybridynError: A package is missing, or the scheduler does not answer.
    """
    check_pool(pool, scheduler)
    name, extra = PACKAGES[pool]
    try:
        import_module(name)
    except ImportError:
        raise HybridynError(f"this needs {name}: {install_advice(extra)}") from None
    jobs = jobs or cores()
    if pool == "loky":
        from joblib.externals.loky import get_reusable_executor

        # Processes that began in another folder are started anew.
        words: Any = {"max_workers": jobs, "initializer": os.chdir, "initargs": (os.getcwd(),)}
        yield Pool(jobs, ThisProcess if jobs == 1 else partial(get_reusable_executor, **words))
        return
    from . import clusters

    with (clusters.open_dask if pool == "dask" else clusters.open_ray)(jobs, scheduler) as cluster:
        yield Pool(*cluster)


def check_pool(pool: str, scheduler: str | None) -> None:
    """Check the choice of processes before any work is done.

    Raises:
        HybridynError: There is no such pool, or the scheduler's address is wrong.
    """
    if pool not in PACKAGES:
        raise HybridynError(f"there is no pool '{pool}'; the pools are {', '.join(PACKAGES)}")
    if scheduler is None:
        return
    if pool not in ADDRESSES:
        raise HybridynError("a scheduler belongs to the pool 'dask' or 'ray'")
    form, example = ADDRESSES[pool]
    if not form.fullmatch(scheduler):
        raise HybridynError(f"'{scheduler}' is no address of a scheduler, like {example}")


def cores() -> int:
    """Return the number of processor cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
