"""Processes of a Ray cluster, on this machine or elsewhere; Ray is imported only here."""

from __future__ import annotations

import contextlib
import itertools
import logging
import socket
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from ...errors import HybridynError
from .pool import WorkerDiedError

ray: Any = import_module("ray")  # hybridyn needs no types of it

#: Time in which a cluster has to accept a connection [s].
PATIENCE = 10.0
#: Errors of tasks whose process or machine is gone.
GONE = (
    ray.exceptions.WorkerCrashedError, ray.exceptions.NodeDiedError, ray.exceptions.OutOfMemoryError,
)  # fmt: skip


@dataclass(frozen=True)
class RayPool:
    """Processes of a Ray cluster, see `pool.Pool`.

    Attributes:
        workers: Number of processors of the cluster.
    """

    workers: int

    def run(self, function: Callable[..., Any], tasks: Iterable[Any], *, at_once: int) -> Iterator[Any]:
        """Call a function of each task, and yield the results as they come."""
        # The first death ends a task: its designs are then tried one at a time.
        call = ray.remote(function).options(num_cpus=1, max_retries=0)
        given = (call.remote(*task) for task in tasks)
        running = list(itertools.islice(given, at_once))
        try:
            while running:
                ready, running = ray.wait(running, num_returns=1)
                yield _result(ready[0])
                running += itertools.islice(given, 1)
        finally:
            for task in running:
                ray.cancel(task)


def _result(task: Any) -> Any:
    """Return the result of a task that has ended."""
    try:
        return ray.get(task)
    except GONE as error:
        raise WorkerDiedError(str(error)) from error
    except ray.exceptions.RayTaskError as error:
        raise error.cause from None


@contextlib.contextmanager
def open_ray(jobs: int, scheduler: str | None) -> Iterator[RayPool]:
    """Connect to a running cluster, or start one on this machine.

    Args:
        jobs: Number of processes of a cluster on this machine.
        scheduler: Address of a running cluster, "host:6379" or "auto", or None.

    Raises:
        HybridynError: The cluster does not answer.
    """
    words: dict[str, Any] = {"address": scheduler} if scheduler else {"num_cpus": jobs, "address": "local"}
    try:
        if scheduler and scheduler != "auto":  # Ray itself tries for minutes
            host, _, port = scheduler.removeprefix("ray://").rpartition(":")
            socket.create_connection((host, int(port)), PATIENCE).close()
        ray.init(**words, include_dashboard=None if scheduler else False, log_to_driver=False,
                 logging_level=logging.CRITICAL, configure_logging=False)  # fmt: skip
    except (OSError, RuntimeError, ValueError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise HybridynError(
            f"the Ray cluster {scheduler or 'of this machine'} does not answer ({reason})"
        ) from None
    try:
        yield RayPool(int(ray.cluster_resources().get("CPU", 1)))
    finally:
        ray.shutdown()
