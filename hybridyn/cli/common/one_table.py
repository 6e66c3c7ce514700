"""One table of many, computed by a command in whatever process, and what became of it."""

from __future__ import annotations

import contextlib
import io
import warnings
from functools import partial
from importlib import import_module
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from ...errors import HybridynError
from .options import RobotChoice
from .text import counted

if TYPE_CHECKING:
    from ...structure.robot import HybridRobot
    from .tables import TableCommand

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


def lost(module: str, options: dict[str, Any]) -> Outcome:
    """Return what became of a table that ended its process each time."""
    from ...studies.sweep.pools import MOST_DEATHS

    source = options["source"]
    times = counted(MOST_DEATHS, "time")
    return Outcome(source, error=f"{source}: its process ended without a result {times}")


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
