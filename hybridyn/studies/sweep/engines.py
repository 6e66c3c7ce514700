"""Other processes: joblib's loky on this machine, or Dask or Ray on this machine or on a cluster."""

from __future__ import annotations

import contextlib
import os
import re
from collections.abc import Iterator
from importlib import import_module
from typing import Any, Literal

from ...errors import HybridynError, install_advice
from .loky_pool import LokyPool
from .pool import Pool

PoolName = Literal["loky", "dask", "ray"]
POOLS: tuple[PoolName, ...] = ("loky", "dask", "ray")
#: Address of a scheduler by pool, and an example.
ADDRESSES = {
    "dask": (re.compile(r"(tcp|tls|ucx|wss?)://\S+:\d+(/\S*)?"), "tcp://host:8786"),
    "ray": (re.compile(r"(ray://)?[^\s:/]+:\d+|auto"), "host:6379"),
}


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
    if pool == "loky":
        yield LokyPool(jobs or cores(), _package("joblib", "sweep"))
        return
    if pool == "ray":
        _package("ray", "ray")
        from .ray_pool import open_ray

        with open_ray(jobs or cores(), scheduler) as cluster:
            yield cluster
        return
    _package("distributed", "dask")
    from .dask_pool import open_dask

    with open_dask(jobs or cores(), scheduler) as cluster:
        yield cluster


def check_pool(pool: str, scheduler: str | None) -> None:
    """Check the choice of processes before any work is done.

    Raises:
        HybridynError: There is no such pool, or the scheduler's address is wrong.
    """
    if pool not in POOLS:
        raise HybridynError(f"there is no pool '{pool}'; the pools are {', '.join(POOLS)}")
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


def _package(name: str, extra: str) -> Any:
    """Import a package of an extra."""
    try:
        return import_module(name)
    except ImportError:
        raise HybridynError(f"this needs {name}: {install_advice(extra)}") from None
