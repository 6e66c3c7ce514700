"""Processes of this machine by joblib's loky; joblib is handed in by `engines`."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import BrokenExecutor
from dataclasses import dataclass
from functools import partial
from typing import Any

from .pool import WorkerDiedError


@dataclass(frozen=True)
class LokyPool:
    """Processes of this machine, see `pool.Pool`; a single one is this process.

    Attributes:
        workers: Their number.
        joblib: The module.
    """

    workers: int
    joblib: Any

    def run(self, function: Callable[..., Any], tasks: Iterable[Any], *, at_once: int) -> Iterator[Any]:
        """Call a function of each task, and yield the results as they come."""
        joblib = self.joblib
        call = function if self.workers == 1 else partial(_in_folder, os.getcwd(), function)
        calls = (joblib.delayed(call)(*task) for task in tasks)
        with joblib.parallel_config(backend="loky", inner_max_num_threads=1):
            parallel = joblib.Parallel(
                batch_size=1, pre_dispatch=at_once, return_as="generator_unordered", n_jobs=self.workers
            )
            try:
                yield from parallel(calls)
            except BrokenExecutor as error:
                raise WorkerDiedError(str(error)) from error


def _in_folder(folder: str, function: Callable[..., Any], *task: Any) -> Any:
    """Call a function in a folder: a process that is used again began in that of an earlier call."""
    os.chdir(folder)
    return function(*task)
