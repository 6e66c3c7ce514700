"""Commands that compute a table, for many tables: a folder or a glob, in several processes, a shard each."""

import contextlib
import glob
import hashlib
import io
import json
import os
import time
from collections.abc import Callable
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import click

from ...description.urdf.robot_folders import recorded
from ...description.writing import locked, write_text
from ...errors import HybridynError
from ...structure.robot import HybridRobot
from ...studies.sweep.pools import MOST_DEATHS, open_pool
from ...threads import one_thread
from .. import explained
from .options import RobotChoice, refuse
from .progress import progress
from .tables import one_table
from .text import counted

#: The file that says what the shards of a folder are: a digest of the command, then for each table that was
#: computed a line with the digests of table and shard.
ABOUT = "tables.txt"
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


def compute_each(command: Callable[..., int], options: dict[str, Any], ending: str, *, resume: bool) -> int:
    """Compute every table that has no shard, and return the exit status.

    Args:
        command: Computes a table.
        options: Its values; `source` names the tables.
        ending: Ending of the shards; "" takes that of the table.

    Raises:
        HybridynError: No table is found, the robot does not load, or the folder has other results.
    """
    started = time.perf_counter()
    refuse(*((options[name], f"--{name} belongs to a single table") for name in ("plot", "reactions")))
    outcomes = list[Outcome]()
    identity = _identity(command, options)
    shards, folder = _shards(options["source"], options["output"], ending), Path(options["output"])
    with locked(folder):
        left = _begin(folder, identity, shards, resume=resume)
        tasks = [
            (command, options | {"source": file, "output": str(shards[file]), "jobs": 1, "quiet": True})
            for file in left
        ]
        try:
            with progress("tables") as show:
                for outcome in open_pool(options["jobs"]).run(compute, tasks, lost) if tasks else ():
                    outcomes.append(outcome)
                    source = outcome.source
                    if outcome.error:
                        click.echo(f"error: {outcome.error}", err=True)
                    elif shards[source].exists():
                        with open(folder / ABOUT, "a", encoding="utf-8") as record:
                            record.write(_line(left[source], shards[source]))
                    show(len(outcomes), len(outcomes) / len(left))
        finally:
            good = sorted(one for one in outcomes if not one.error)
            for one in good:
                click.echo(f"{one.source}:\n{one.text}" if one.text else "", nl=False)
            there, todo = len(shards) - len(left) + len(good), len(left) - len(good)
            more = f"\n{counted(todo, 'table')} left; continue with --resume" if todo else ""
            click.echo(
                f"{counted(there, 'table')} of {len(shards):,} in '{folder}', "
                f"{len(good):,} computed now{more}\nwall time {time.perf_counter() - started:.2f} s",
                err=True,
            )
    return FAILED if todo else max((one.status for one in outcomes), default=0)


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


def _identity(command: Callable[..., int], options: dict[str, Any]) -> str:
    """Compute a digest of the command, its options, and the files of the robot but meshes; it must load."""
    about_files = ("source", "output", "jobs", "quiet")
    said = {key: repr(options[key]) for key in sorted(options) if key not in about_files}
    with recorded() as files:
        options["load"]()
    return hashlib.sha256(json.dumps([command.__module__, said, sorted(files.items())]).encode()).hexdigest()


def _begin(folder: Path, identity: str, shards: dict[str, Path], *, resume: bool) -> dict[str, str]:
    """Begin or continue the shards in a folder, and return the digests of the tables to compute.

    A table is done if the folder has the bytes that were computed from the table's bytes.
    """
    about = folder / ABOUT
    text = about.read_text(encoding="utf-8") if about.exists() else ""
    before, *lines = text.splitlines(keepends=True) or [""]
    there = {file for file, shard in shards.items() if shard.exists()}
    if before and there:
        if not resume:
            raise HybridynError(
                f"{folder}: has shards of an earlier run: continue it with resume=True, or choose another "
                "folder"
            )
        if before.strip() != identity:
            raise HybridynError(
                f"{folder}: its shards are of other options, or of a robot that has changed: choose another "
                "folder"
            )
    known, digests = set(lines), {file: _digest(file) for file in shards}
    done = {file: line for file in there if (line := _line(digests[file], shards[file])) in known}
    write_text(about, "".join([f"{identity}\n", *done.values()]))
    return {file: digest for file, digest in digests.items() if file not in done}


def _line(digest: str, shard: Path) -> str:
    """Return the line that records a shard, from the digest of its table."""
    return f"{digest} {_digest(shard)}\n"


def _digest(path: str | Path) -> str:
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def lost(command: Callable[..., int], options: dict[str, Any]) -> Outcome:
    """Return what became of a table that ended its process each time."""
    source = options["source"]
    return Outcome(
        source, error=f"{source}: its process ended without a result {counted(MOST_DEATHS, 'time')}"
    )


def compute(command: Callable[..., int], options: dict[str, Any]) -> Outcome:
    """Compute one table, in whatever process; the first process has printed the notes on the robot."""
    source, out = options["source"], io.StringIO()
    try:
        with one_thread(), contextlib.redirect_stdout(out), contextlib.redirect_stderr(io.StringIO()):
            status = one_table(command, options | {"load": partial(_robot, options["load"])})
    except (HybridynError, OSError, click.ClickException) as error:
        said = " ".join(explained(error)[0].split())
        return Outcome(source, error=said if said.startswith(source) else f"{source}: {said}")
    return Outcome(source, status, out.getvalue())


@lru_cache(1)
def _robot(choice: RobotChoice) -> HybridRobot:
    """Load a robot, unless this process has just had it."""
    return choice()
