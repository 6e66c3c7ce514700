"""Other processes: joblib's loky on this machine, or Dask on this machine or on a cluster."""

from __future__ import annotations

import contextlib
import logging
import os
import queue
import re
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import BrokenExecutor
from dataclasses import dataclass
from importlib import import_module
from typing import Any, Literal

from ...errors import HybridynError, install_advice

Engine = Literal["loky", "dask"]
ENGINES: tuple[Engine, ...] = ("loky", "dask")
#: Time in which the scheduler of a cluster has to answer [s].
PATIENCE = 10.0
#: Further time for the answer to a refused or unknown address, which comes with a reason [s].
ADDRESS_SECONDS = 1.0


#: Address of a scheduler.
ADDRESS = re.compile(r"(tcp|tls|ucx|wss?)://\S+:\d+(/\S*)?")


class WorkerDiedError(Exception):
    """A worker process ended in the middle of its work."""


@dataclass(frozen=True)
class Pool:
    """Processes that are ready.

    Attributes:
        workers: Their number.
        options: Arguments of `joblib.parallel_config`.
        joblib: The module.
    """

    workers: int
    options: dict[str, Any]
    joblib: Any

    def run(self, function: Callable[..., Any], tasks: Iterable[Any], *, at_once: int) -> Iterator[Any]:
        """Call a function of each task, and yield the results as they come.

        Args:
            function: The function.
            tasks: Tuples of arguments, taken one by one.
            at_once: Largest number of tasks that wait or run.

        Raises:
            WorkerDiedError: A process ended; the tasks without a result have to be given again.
        """
        joblib = self.joblib
        calls = (joblib.delayed(function)(*task) for task in tasks)
        with joblib.parallel_config(**self.options):
            parallel = joblib.Parallel(
                batch_size=1, pre_dispatch=at_once, return_as="generator_unordered", n_jobs=self.workers
            )
            try:
                yield from parallel(calls)
            except _deaths() as error:
                raise WorkerDiedError(str(error)) from error


def cores() -> int:
    """Return the number of processor cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


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
    if scheduler is not None and engine != "dask":
        raise HybridynError("a scheduler belongs to the engine 'dask'")
    if engine not in ENGINES:
        raise HybridynError(f"there is no engine '{engine}'; the engines are {', '.join(ENGINES)}")
    if scheduler is not None and not ADDRESS.fullmatch(scheduler):
        raise HybridynError(f"'{scheduler}' is no address of a scheduler, like tcp://host:8786")
    joblib = _package("joblib")
    if engine == "loky":
        options = {"backend": "loky", "inner_max_num_threads": 1}
        yield Pool(jobs or cores(), options, joblib)
        return
    with _client(_package("distributed"), jobs, scheduler) as client:
        workers = sum(client.ncores().values())
        yield Pool(workers, {"backend": "dask", "client": client}, joblib)


@contextlib.contextmanager
def _client(distributed: Any, jobs: int | None, scheduler: str | None) -> Iterator[Any]:
    """Yield a client of a cluster that stands, or of one on this machine."""
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # errors are raised, and said once
    with contextlib.ExitStack() as stack:
        if scheduler is None:
            cluster = distributed.LocalCluster(
                n_workers=jobs or cores(), threads_per_worker=1, dashboard_address=None
            )
            address = stack.enter_context(cluster)
        else:
            address = scheduler
        client = stack.enter_context(_connected(distributed, address))
        if not client.ncores():
            try:
                client.wait_for_workers(1, timeout=PATIENCE)
            except TimeoutError:
                raise HybridynError(f"the scheduler {scheduler} has no workers") from None
        yield client


def _connected(distributed: Any, address: Any) -> Any:
    """Connect to a scheduler, in a thread: Dask's own timeout does not end a wait for one that stays silent.

    Raises:
        HybridynError: The scheduler does not answer.
    """
    found: queue.Queue[Any] = queue.Queue()

    def connect() -> None:
        try:
            found.put(distributed.Client(address, timeout=PATIENCE, set_as_default=False))
        except Exception as error:
            found.put(error)

    threading.Thread(target=connect, daemon=True).start()
    try:
        answer = found.get(timeout=PATIENCE + ADDRESS_SECONDS)
    except queue.Empty:
        answer = TimeoutError("it accepts the connection and stays silent")
    if isinstance(answer, Exception):
        reason = str(answer).splitlines()[0] if str(answer) else type(answer).__name__
        raise HybridynError(f"the scheduler {address} does not answer within {PATIENCE:g} s ({reason})")
    return answer


def _deaths() -> tuple[type[Exception], ...]:
    """Return the errors of engines whose worker died, Dask's where it is loaded."""
    module = sys.modules.get("distributed")
    return (BrokenExecutor, module.KilledWorker) if module is not None else (BrokenExecutor,)


def _package(name: str) -> Any:
    """Import a package of the extra.

    Raises:
        HybridynError: It is not installed.
    """
    try:
        return import_module(name)
    except ImportError:
        raise HybridynError(f"this needs {name}: {install_advice('sweep')}") from None
