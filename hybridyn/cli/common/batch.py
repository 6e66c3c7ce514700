"""Commands that compute a table, for many tables: a folder or a glob, in several processes, a shard each."""

import contextlib
import glob
import io
import os
import time
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import click

from ...description.bounds import recorded
from ...errors import HybridynError
from ...structure.robot import HybridRobot
from ...studies.pools import MOST_DEATHS, open_pool
from ...studies.results_folder import by_name, digest, part, writing
from ...threads import one_thread
from .. import explained
from .executors import Asked, processes
from .one_table import one_table
from .options import RobotChoice, refuse
from .progress import progress
from .text import counted

#: Options that change no shard, and that of the robot, whose parts are named by themselves.
OTHERS = ("source", "output", "jobs", "quiet", "load")
#: Exit status where a table failed.
FAILED = 1


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


def compute_each(
    command: Callable[..., int], options: dict[str, Any], ending: str, where: Asked, *, resume: bool
) -> int:
    """Compute every table that has no shard, and return the exit status.

    Args:
        command: Computes a table.
        options: Its values; `source` names the tables.
        ending: Ending of the shards; "" takes that of the table.
        where: What computes.

    Raises:
        HybridynError: No table is found, the robot does not load, or the folder has other results.
    """
    started = time.perf_counter()
    refuse(*((options[name], f"--{name} belongs to a single table") for name in ("plot", "reactions")))
    outcomes, shards = list[Outcome](), _shards(options["source"], options["output"], ending)
    names = [glob.escape(shard.name) for shard in shards.values()]
    with writing(options["output"], _asked(command, options), {}, names, resume=resume) as record:
        digests = {file: digest(file) for file in shards}
        left = [file for file in shards if not record.has(shards[file].name, digests[file])]
        tasks = [
            (command, options | {"source": file}, shards[file], digests[file], record.asked) for file in left
        ]
        try:
            with processes(where) as there_are, progress("tables") as show:
                for outcome in open_pool(*there_are).run(compute, tasks, lost) if tasks else ():
                    outcomes.append(outcome)
                    if outcome.error:
                        click.echo(f"error: {outcome.error}", err=True)
                    show(len(outcomes), len(outcomes) / len(left))
        finally:
            good = sorted(one for one in outcomes if not one.error)
            todo = len(left) - len(good)
            _say_done(good, record.folder, len(shards), todo, started)
    return FAILED if todo else max((one.status for one in outcomes), default=0)


def _say_done(good: Sequence[Outcome], folder: Path, tables: int, todo: int, started: float) -> None:
    """Print what the commands printed, and how many tables have results and are left.

    Args:
        good: The outcomes without errors.
        folder: Folder of the results.
        tables: Number of all tables.
        todo: Number of those left.
        started: When the work began, by `time.perf_counter` [s].
    """
    for one in good:
        click.echo(f"{one.source}:\n{one.text}" if one.text else "", nl=False)
    more = f"\n{counted(todo, 'table')} left; continue with --resume" if todo else ""
    click.echo(
        f"{counted(tables - todo, 'table')} of {tables:,} in '{folder}', {len(good):,} computed now{more}\n"
        f"wall time {time.perf_counter() - started:.2f} s",
        err=True,
    )


def _shards(source: str, output: str | None, ending: str) -> dict[str, Path]:
    """Return the shard of each table."""
    pattern = os.path.join(glob.escape(source), "*.parquet") if os.path.isdir(source) else source
    files = sorted(file for file in glob.glob(pattern, recursive=True) if os.path.isfile(file))
    advice = f"; others by a glob: '{os.path.join(source, '*.csv')}'" if os.path.isdir(source) else ""
    nowhere = output in (None, "-") or (os.path.exists(str(output)) and not os.path.isdir(str(output)))
    refuse(
        (nowhere, "several tables need a folder for their shards: -o FOLDER"),
        (not files, f"'{pattern}' matches no table{advice}"),
    )
    shards: dict[str, Path] = {}
    taken = {os.path.realpath(file): "a table" for file in files}
    for file in files:
        stem, own = os.path.splitext(os.path.basename(file))
        shards[file] = shard = Path(str(output), stem + (ending or own))
        place = os.path.realpath(shard)
        refuse((place in taken, f"'{shard}', the shard of '{file}', would replace {taken.get(place)}"))
        taken[place] = f"that of '{file}'"
    return shards


def _asked(command: Callable[..., int], options: dict[str, Any]) -> dict[str, str]:
    """Return what is asked: command, options, and digests of the robot's files but meshes; it must load."""
    choice: RobotChoice = options["load"]
    with recorded() as files:
        choice()
    words = options | vars(choice) | {"robot": os.path.basename(choice.robot)}
    said = {one.name: max(one.opts, key=len) for one in click.get_current_context().command.params}
    asked = {said.get(name, name): repr(words[name]) for name in words if name not in OTHERS}
    return {"command": command.__module__, **asked, **by_name(files)}


def lost(command: Callable[..., int], options: dict[str, Any], *_: object) -> Outcome:
    """Return what became of a table that ended its process each time."""
    why = f"its process ended without a result {counted(MOST_DEATHS, 'time')}"
    return Outcome(options["source"], error=f"{options['source']}: {why}")


def compute(
    command: Callable[..., int], options: dict[str, Any], shard: Path, of: str, asked: Mapping[str, str]
) -> Outcome:
    """Compute one table, in whatever process; the first process has printed the notes on the robot."""
    source, out, draft = options["source"], io.StringIO(), shard
    robot = partial(_robot, options["load"], tuple(asked.items()))
    own = {"load": robot, "jobs": 1, "quiet": True}
    try:
        with (
            one_thread(), contextlib.redirect_stdout(out), contextlib.redirect_stderr(io.StringIO()),
            part(shard.parent, shard.name, of, asked) as draft,
        ):  # fmt: skip
            status = one_table(command, options | own | {"output": str(draft)})
    except (HybridynError, OSError, click.ClickException) as error:
        said = " ".join(explained(error)[0].replace(str(draft), str(shard)).split())
        return Outcome(source, error=said if said.startswith(source) else f"{source}: {said}")
    return Outcome(source, status, out.getvalue())


@lru_cache(1)
def _robot(choice: RobotChoice, asked: tuple[tuple[str, str], ...]) -> HybridRobot:
    """Load a robot, unless this process has just had it, of the same files."""
    return choice()
