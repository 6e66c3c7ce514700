"""Processes that a command does not start itself: `--executor` and `--dask`."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from importlib import import_module
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from ...errors import HybridynError, required
from .options import refuse

if TYPE_CHECKING:  # most commands start no processes
    from concurrent.futures import Executor

#: Time after which a scheduler is not there, or has no worker [s].
PATIENCE = 30


class Asked(NamedTuple):
    """The values of the options.

    Attributes:
        jobs: `--jobs`, or None.
        executor: `--executor`, MODULE:FUNCTION, or None.
        dask: `--dask`, the address of a scheduler, or None.
    """

    jobs: int | None
    executor: str | None
    dask: str | None


@contextmanager
def processes(asked: Asked) -> Iterator[tuple[int | None, Callable[[], Executor] | None]]:
    """Yield the number of processes, None for one per core, and what starts them, None for this machine.

    Raises:
        UsageError: The function is not to be had, or both options are given.
        HybridynError: No scheduler answers, or it has no worker.
    """
    refuse((asked.executor and asked.dask, "--executor and --dask exclude each other"))
    if asked.dask is None:
        yield asked.jobs, _function(asked.executor) if asked.executor else None
        return
    import logging  # which distributed imports, too

    distributed = required("distributed", "dask", "--dask")
    for logger in ("distributed", "distributed.client"):  # the one line of an error says it
        logging.getLogger(logger).setLevel(logging.CRITICAL)
    client = _client(distributed, asked.dask)
    try:
        workers = len(client.scheduler_info(n_workers=-1)["workers"])
        yield asked.jobs or workers, partial(client.get_executor, pure=False)
    finally:
        client.close(timeout=1)


def _client(distributed: Any, address: str) -> Any:
    """Connect with a scheduler that has a worker."""
    try:
        client = distributed.Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError) as error:
        raise HybridynError(
            f"--dask: no scheduler of Dask answers at '{address}' ({type(error).__name__}: {error})"
        ) from None
    try:
        client.wait_for_workers(1, timeout=PATIENCE)
    except TimeoutError:
        client.close(timeout=1)
        raise HybridynError(
            f"--dask: the scheduler at '{address}' has had no worker for {PATIENCE} s: start some"
        ) from None
    return client


def _function(word: str) -> Callable[[], Executor]:
    """Import MODULE:FUNCTION, from this folder or from what is installed.

    Raises:
        UsageError: There is no such module or function, or the module fails.
    """
    module, _, name = word.partition(":")
    if not module or not name:
        raise click.UsageError(f"--executor: '{word}' is not of the form MODULE:FUNCTION")
    sys.path.insert(0, "")
    try:
        function = getattr(import_module(module), name)
    except Exception as error:
        raise click.UsageError(f"--executor {word}: {type(error).__name__}: {error}") from None
    finally:
        sys.path.remove("")
    if not callable(function):
        raise click.UsageError(f"--executor {word}: '{name}' is no function")
    found: Callable[[], Executor] = function
    return found
