"""Other processes: joblib's loky on this machine, or Dask on this machine or on a cluster."""

from __future__ import annotations

import contextlib
import os
import re
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import BrokenExecutor
from dataclasses import dataclass
from importlib import import_module
from typing import Any, Literal, Protocol

from ...errors import HybridynError, install_advice

Engine = Literal["loky", "dask"]
ENGINES: tuple[Engine, ...] = ("loky", "dask")
#: Address of a scheduler.
ADDRESS = re.compile(r"(tcp|tls|ucx|wss?)://\S+:\d+(/\S*)?")


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

        Args:
            function: The function.
            tasks: Tuples of arguments, taken one by one.
            at_once: Largest number of tasks that wait or run.

        Raises:
            WorkerDiedError: A process ended; the tasks without a result have to be given again.
        """
        ...


@dataclass(frozen=True)
class LokyPool:
    """Processes of this machine, see `Pool`; a single one is this process.

    Attributes:
        workers: Their number.
        joblib: The module.
    """

    workers: int
    joblib: Any

    def run(self, function: Callable[..., Any], tasks: Iterable[Any], *, at_once: int) -> Iterator[Any]:
        """Call a function of each task, and yield the results as they come."""
        joblib = self.joblib
        calls = (joblib.delayed(function)(*task) for task in tasks)
        with joblib.parallel_config(backend="loky", inner_max_num_threads=1):
            parallel = joblib.Parallel(
                batch_size=1, pre_dispatch=at_once, return_as="generator_unordered", n_jobs=self.workers
            )
            try:
                yield from parallel(calls)
            except BrokenExecutor as error:
                raise WorkerDiedError(str(error)) from error


@contextlib.contextmanager
def open_pool(engine: Engine, jobs: int | None, scheduler: str | None) -> Iterator[Pool]:
    """Start processes, or connect to a cluster.

    Args:
        engine: "loky", or "dask".
        jobs: Number of processes; one per core by default. A cluster has its own number.
        scheduler: Address of a Dask cluster that stands, "tcp://host:8786".

    Raises:
        HybridynError: A package is missing, or the scheduler does not answer.
    """
    check_engine(engine, scheduler)
    if engine == "loky":
        yield LokyPool(jobs or cores(), _package("joblib", "sweep"))
        return
    _package("distributed", "dask")
    from .dask_pool import open_dask

    with open_dask(jobs or cores(), scheduler) as pool:
        yield pool


def check_engine(engine: str, scheduler: str | None) -> None:
    """Check the choice of an engine before any work is done.

    Raises:
        HybridynError: There is no such engine, or the scheduler's address is wrong.
    """
    if engine not in ENGINES:
        raise HybridynError(f"there is no engine '{engine}'; the engines are {', '.join(ENGINES)}")
    if scheduler is not None and engine != "dask":
        raise HybridynError("a scheduler belongs to the engine 'dask'")
    if scheduler is not None and not ADDRESS.fullmatch(scheduler):
        raise HybridynError(f"'{scheduler}' is no address of a scheduler, like tcp://host:8786")


def cores() -> int:
    """Return the number of processor cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _package(name: str, extra: str) -> Any:
    """Import a package of an extra.

    Raises:
        HybridynError: It is not installed.
    """
    try:
        return import_module(name)
    except ImportError:
        raise HybridynError(f"this needs {name}: {install_advice(extra)}") from None
