"""One table of many, computed by a command in whatever process, and what became of it."""

from __future__ import annotations

import contextlib
import io
import warnings
from collections.abc import Iterator, Sequence
from functools import partial
from importlib import import_module
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from ...errors import HybridynError
from .options import RobotChoice
from .text import counted

if TYPE_CHECKING:
    from ...structure.robot import HybridRobot
    from ...studies.sweep.pool import Pool
    from .tables import TableCommand

#: Tables per process that are given in advance.
AHEAD = 2
#: Times that a table may end its process before it counts as failed.
MOST_DEATHS = 2

#: The robot of the last table that this process computed, by the choice of the user.
_kept: dict[str, HybridRobot] = {}


class Outcome(NamedTuple):
    """What became of a table.

    Attributes:
        source: The table.
        status: Exit status of the command.
        text: What the command printed on standard output.
        error: The error, one line, or "".
    """

    source: str
    status: int = 0
    text: str = ""
    error: str = ""


def outcomes(pool: Pool, module: str, tasks: Sequence[dict[str, Any]]) -> Iterator[Outcome]:
    """Compute tables in other processes; after the death of one, its tables are computed one at a time."""
    from ...studies.sweep.pool import WorkerDiedError

    left = {task["source"]: (module, task) for task in tasks}

    def some(given: Sequence[str], at_once: int) -> Iterator[Outcome]:
        """Compute some tables."""
        for outcome in pool.run(compute, (left[source] for source in given), at_once=at_once):
            del left[outcome.source]
            yield outcome

    def alone(source: str) -> Iterator[Outcome]:
        """Compute a table that may have ended its process."""
        for _ in range(MOST_DEATHS):
            with contextlib.suppress(WorkerDiedError):
                yield from some([source], 1)
                return
        del left[source]
        times = counted(MOST_DEATHS, "time")
        yield Outcome(source, error=f"{source}: its process ended without a result {times}")

    while left:
        try:
            yield from some(list(left), AHEAD * pool.workers)
        except WorkerDiedError:
            for source in list(left)[: AHEAD * pool.workers]:  # the tables that were given are the first
                yield from alone(source)


def compute(module: str, options: dict[str, Any]) -> Outcome:
    """Compute one table by a command.

    Raises:
        OSError: The disk is full.
    """
    import logging  # one table alone needs none

    from ...description.writing import FULL
    from ...threads import one_thread

    command: TableCommand = import_module(module).command
    source: str = options["source"]
    log = logging.getLogger("hybridyn")
    before = log.level
    log.setLevel(logging.ERROR)  # the first process has said what looks wrong in the robot
    out = io.StringIO()
    try:
        with (
            one_thread(), warnings.catch_warnings(), contextlib.redirect_stdout(out),
            contextlib.redirect_stderr(io.StringIO()),
        ):  # fmt: skip
            warnings.simplefilter("ignore")
            load = partial(_robot, options["load"])
            status = command.one({**options, "load": load})
    except OSError as error:
        if error.errno in FULL:
            raise
        return Outcome(source, error=f"{error.filename or source}: {error.strerror}")
    except (HybridynError, click.ClickException) as error:
        said = " ".join(str(error).split())
        return Outcome(source, error=said if said.startswith(source) else f"{source}: {said}")
    finally:
        log.setLevel(before)
    return Outcome(source, status or 0, out.getvalue())


def _robot(choice: RobotChoice) -> HybridRobot:
    """Load a robot, unless this process has just had it."""
    key = repr(choice)
    if key not in _kept:
        _kept.clear()
        _kept[key] = choice()
    return _kept[key]
