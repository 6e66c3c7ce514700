"""Clusters of Dask and Ray as executors, here or elsewhere; their packages are imported when used."""

from __future__ import annotations

import contextlib
import functools
import logging
import socket
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Executor, Future
from importlib import import_module
from threading import Thread
from typing import Any, NamedTuple

from ...errors import HybridynError

#: Time in which a cluster has to answer [s].
PATIENCE = 10.0
#: Further time for the answer to a refused or unknown address, which comes with a reason [s].
ADDRESS_SECONDS = 1.0


class Cluster(NamedTuple):
    """What a `pools.Pool` needs of a cluster."""

    workers: int
    start: Callable[[], Executor]
    died: tuple[type[BaseException], ...]


@contextlib.contextmanager
def open_dask(jobs: int, scheduler: str | None) -> Iterator[Cluster]:
    """Connect to a running cluster, or start one on this machine.

    Args:
        jobs: Number of processes of a cluster on this machine.
        scheduler: Address of a running cluster, or None.

    Raises:
        HybridynError: The scheduler does not answer, has no workers, or is gone.
    """
    dask, distributed = (import_module(name) for name in ("dask", "distributed"))
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # errors are raised, and said once
    with contextlib.ExitStack() as stack:
        address: Any = scheduler
        if scheduler is None:
            # The first death ends a task, which is then tried alone.
            stack.enter_context(dask.config.set({"distributed.scheduler.allowed-failures": 0}))
            address = stack.enter_context(
                distributed.LocalCluster(
                    n_workers=jobs, threads_per_worker=1, dashboard_address=None,
                    silence_logs=logging.CRITICAL,
                )
            )  # fmt: skip
        client = stack.enter_context(_connected(distributed.Client, address))
        if not client.ncores():
            try:
                client.wait_for_workers(1, timeout=PATIENCE)
            except TimeoutError:
                raise HybridynError(f"the scheduler {scheduler} has no workers") from None
        start = functools.partial(client.get_executor, pure=False)
        try:
            yield Cluster(sum(client.ncores().values()), start, (distributed.KilledWorker,))
        except CancelledError:
            raise HybridynError("the scheduler of the cluster is gone; continue with resume=True") from None


def _connected(client: Callable[..., Any], address: Any) -> Any:
    """Connect to a scheduler, in a thread: Dask's own timeout does not end a wait for one that stays silent.

    Raises:
        HybridynError: The scheduler does not answer.
    """
    found: Future[Any] = Future()

    def connect() -> None:
        """Connect to the scheduler, which may never answer."""
        try:
            found.set_result(client(address, timeout=PATIENCE, set_as_default=False))
        except Exception as error:
            found.set_exception(error)

    Thread(target=connect, daemon=True).start()
    try:
        return found.result(PATIENCE + ADDRESS_SECONDS)
    except Exception as error:
        raise HybridynError(
            f"the scheduler {address} does not answer within {PATIENCE:g} s ({_reason(error)})"
        ) from None


@contextlib.contextmanager
def open_ray(jobs: int, scheduler: str | None) -> Iterator[Cluster]:
    """Connect to a running cluster, or start one on this machine.

    Args:
        jobs: Number of processes of a cluster on this machine.
        scheduler: Address of a running cluster, "host:6379" or "auto", or None.

    Raises:
        HybridynError: The cluster does not answer.
    """
    ray = import_module("ray")
    words: dict[str, Any] = {"address": scheduler} if scheduler else {"num_cpus": jobs, "address": "local"}
    try:
        if scheduler and scheduler != "auto":  # Ray itself tries for minutes
            host, _, port = scheduler.removeprefix("ray://").rpartition(":")
            socket.create_connection((host, int(port)), PATIENCE).close()
        ray.init(**words, include_dashboard=None if scheduler else False, log_to_driver=False,
                 logging_level=logging.CRITICAL, configure_logging=False)  # fmt: skip
    except (OSError, RuntimeError, ValueError) as error:
        raise HybridynError(
            f"the Ray cluster {scheduler or 'of this machine'} does not answer ({_reason(error)})"
        ) from None
    gone = ("WorkerCrashedError", "NodeDiedError", "OutOfMemoryError")
    died = tuple(getattr(ray.exceptions, name) for name in gone)
    try:
        yield Cluster(int(ray.cluster_resources().get("CPU", 1)), functools.partial(_Ray, ray), died)
    except ray.exceptions.RayTaskError as error:
        raise error.cause from None
    finally:
        ray.shutdown()


class _Ray(Executor):
    """Ray's tasks as those of an executor."""

    def __init__(self, ray: Any) -> None:
        # The first death ends a task, which is then tried alone.
        self.remote = functools.cache(
            lambda function: ray.remote(function).options(num_cpus=1, max_retries=0)
        )

    def submit(self, function: Callable[..., Any], /, *task: Any, **words: Any) -> Future[Any]:
        """Give a task to the cluster."""
        future: Future[Any] = self.remote(function).remote(*task, **words).future()
        return future


def _reason(error: Exception) -> str:
    """Return the first line of an error."""
    return str(error).splitlines()[0] if str(error) else type(error).__name__
