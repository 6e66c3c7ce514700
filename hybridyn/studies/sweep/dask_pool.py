"""Processes of a Dask cluster, on this machine or elsewhere; Dask is imported only here.

Tasks are given to Dask itself: joblib's Dask backend waits for ever for a task that ends every worker.
"""

from __future__ import annotations

import contextlib
import itertools
import logging
import queue
import threading
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from ...errors import HybridynError
from .pool import WorkerDiedError

dask: Any = import_module("dask")  # without types of its own
distributed: Any = import_module("distributed")

#: Time in which the scheduler of a cluster has to answer [s].
PATIENCE = 10.0
#: Further time for the answer to a refused or unknown address, which comes with a reason [s].
ADDRESS_SECONDS = 1.0


@dataclass(frozen=True)
class DaskPool:
    """Processes of a Dask cluster, see `pool.Pool`.

    Attributes:
        workers: Number of threads of the workers.
    """

    workers: int
    client: Any

    def run(self, function: Callable[..., Any], tasks: Iterable[Any], *, at_once: int) -> Iterator[Any]:
        """Call a function of each task, and yield the results as they come."""
        given = (self.client.submit(function, *task, pure=False) for task in tasks)
        running = set(itertools.islice(given, at_once))
        ends = distributed.as_completed(running, loop=self.client.loop)
        try:
            for future in ends:
                running.discard(future)
                yield _result(future)
                for another in itertools.islice(given, 1):
                    running.add(another)
                    ends.add(another)
        finally:
            if running:
                self.client.cancel(list(running))


def _result(future: Any) -> Any:
    """Return the result of a task that has ended.

    Raises:
        WorkerDiedError: Its workers died, each time that it was tried.
        HybridynError: The scheduler is gone.
    """
    if future.status == "finished":
        return future.result()
    error = future.exception() if future.status == "error" else None
    if isinstance(error, distributed.KilledWorker):
        raise WorkerDiedError(str(error))
    if error is None:
        raise HybridynError("the scheduler of the cluster is gone; continue with resume=True")
    raise error


@contextlib.contextmanager
def open_dask(jobs: int, scheduler: str | None) -> Iterator[DaskPool]:
    """Connect to a running cluster, or start one on this machine.

    Args:
        jobs: Number of processes of a cluster on this machine.
        scheduler: Address of a running cluster, or None.

    Raises:
        HybridynError: The scheduler does not answer, or has no workers.
    """
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # errors are raised, and said once
    with contextlib.ExitStack() as stack:
        if scheduler is None:
            # The first death ends a task: its designs are then tried one at a time.
            stack.enter_context(dask.config.set({"distributed.scheduler.allowed-failures": 0}))
            cluster = distributed.LocalCluster(
                n_workers=jobs, threads_per_worker=1, dashboard_address=None, silence_logs=logging.CRITICAL
            )
            address = stack.enter_context(cluster)
        else:
            address = scheduler
        client = stack.enter_context(_connected(address))
        if not client.ncores():
            try:
                client.wait_for_workers(1, timeout=PATIENCE)
            except TimeoutError:
                raise HybridynError(f"the scheduler {scheduler} has no workers") from None
        yield DaskPool(sum(client.ncores().values()), client)


def _connected(address: Any) -> Any:
    """Connect to a scheduler, in a thread: Dask's own timeout does not end a wait for one that stays silent.

    Raises:
        HybridynError: The scheduler does not answer.
    """
    found: queue.Queue[Any] = queue.Queue()

    def connect() -> None:
        """Connect to the scheduler, which may never answer."""
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
