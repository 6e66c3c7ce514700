"""What a command computes from a table, for one or for each of several ones."""

from collections.abc import Callable
from typing import Any

import click

from .files import report_file, result_file, several
from .one_table import one_table
from .options import refuse


def for_each_table(compute: Callable[..., int], words: dict[str, Any], *, report: bool = False) -> int:
    """Compute a table, or each of several ones, and return the exit status.

    Args:
        compute: Function of `tables`, the files, and the other values, that computes a table.
        words: Values of arguments and options.
        report: Whether the result is no table but a report, .csv or .json.
    """
    resume, executor, dask = (words.pop(name) for name in ("resume", "executor", "dask"))
    if several(words["source"]):
        from .batch import compute_each
        from .executors import Asked  # one table needs none

        asked = Asked(words["jobs"], executor, dask)
        return compute_each(compute, words, ".csv" if report else "", asked, resume=resume)
    named = {"--resume": resume, "--executor": executor, "--dask": dask}
    refuse(*((there, f"{name} belongs to several tables") for name, there in named.items()))
    (report_file if report else result_file)(click.get_current_context(), None, words["output"])
    return one_table(compute, words)
