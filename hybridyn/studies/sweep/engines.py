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

Engine = Literal["loky", "dask", "ray"]
ENGINES: tuple[Engine, ...] = ("loky", "dask", "ray")
#: Address of a scheduler by engine, and an example.
ADDRESSES = {
    "dask": (re.compile(r"(tcp|tls|ucx|wss?)://\S+:\d+(/\S*)?"), "tcp://host:8786"),
    "ray": (re.compile(r"(ray://)?[^\s:/]+:\d+|auto"), "host:6379"),
}


@contextlib.contextmanager
def open_pool(engine: Engine, jobs: int | None, scheduler: str | None) -> Iterator[Pool]:
    """Start processes, or connect to a cluster.

    Args:
        engine: "loky", "dask" or "ray".
        jobs: Number of processes; one per core by default. A cluster has its own number.
        scheduler: Address of a running cluster: of Dask, "tcp://host:8786", or of Ray, "host:6379".

    Raises:
        HybridynError: A package is missing, or the scheduler does not answer.
    """
    check_engine(engine, scheduler)
    if engine == "loky":
        yield LokyPool(jobs or cores(), _package("joblib", "sweep"))
        return
    if engine == "ray":
        _package("ray", "ray")
        from .ray_pool import open_ray

        with open_ray(jobs or cores(), scheduler) as cluster:
            yield cluster
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
    if scheduler is None:
        return
    if engine not in ADDRESSES:
        raise HybridynError("a scheduler belongs to the engine 'dask' or 'ray'")
    form, example = ADDRESSES[engine]
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
