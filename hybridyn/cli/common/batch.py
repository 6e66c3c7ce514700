"""Commands that compute a table, for many tables: a folder or a glob, in several processes, a shard each."""

from __future__ import annotations

import contextlib
import glob
import hashlib
import io
import json
import os
import time
import warnings
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from ...description.urdf.robot_folders import recorded
from ...description.writing import locked, write_text
from ...errors import HybridynError
from .options import RobotChoice
from .progress import Progress
from .text import counted

if TYPE_CHECKING:
    from ...structure.robot import HybridRobot
    from .tables import TableCommand

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


def several(word: str) -> bool:
    """Return whether a word names several tables: it is a folder, or a pattern and no file."""
    return os.path.isdir(word) or (glob.has_magic(word) and not os.path.exists(word))


def compute_each(command: TableCommand, options: dict[str, Any], ending: str, *, resume: bool) -> int:
    """Compute every table that has no shard, and return the exit status.

    Args:
        command: The command that computes a table.
        options: Its options; `source` names the tables.
        ending: Ending of the shards; "" takes that of the table.

    Raises:
        HybridynError: No table is found, the robot does not load, or the folder has other results.
        OSError: The disk is full; the shards so far are complete.
    """
    from ...studies.sweep.pools import open_pool

    started = time.perf_counter()
    for name in ("plot", "reactions"):
        if options.get(name):
            raise click.UsageError(f"--{name} belongs to a single table")
    options["load"]()  # a robot that does not load is one error, and not one for each table
    assert command.callback is not None
    module, outcomes = command.callback.__module__, list[Outcome]()
    identity = _identity(module, options)
    shards, folder = _shards(options["source"], options["output"], ending), Path(options["output"])
    with locked(folder):
        left = _begin(folder, identity, shards, resume=resume)
        tasks = [
            (module, options | {"source": file, "output": str(shards[file]), "jobs": 1, "quiet": True})
            for file in left
        ]
        try:
            if left:
                with Progress("tables") as bar:
                    for outcome in open_pool(options["jobs"]).run(compute, tasks, lost):
                        outcomes.append(outcome)
                        source = outcome.source
                        if outcome.error:
                            click.echo(f"error: {outcome.error}", err=True)
                        elif shards[source].exists():
                            with open(folder / ABOUT, "a", encoding="utf-8") as record:
                                record.write(_line(left[source], shards[source]))
                        bar.show(len(outcomes), len(outcomes) / len(left))
        finally:
            _report(outcomes, len(shards), len(left), folder, time.perf_counter() - started)
    return FAILED if any(one.error for one in outcomes) else max((one.status for one in outcomes), default=0)


def _report(outcomes: list[Outcome], tables: int, now: int, folder: Path, seconds: float) -> None:
    """Print what the commands printed, in the order of the tables, and what became of the tables."""
    for one in sorted(outcomes):
        if one.text and not one.error:
            click.echo(f"{one.source}:\n{one.text}", nl=False)
    failed = sum(bool(one.error) for one in outcomes)
    good = len(outcomes) - failed
    lines = [f"{counted(tables - now + good, 'table')} of {tables:,} in '{folder}', {good:,} computed now"]
    if failed:
        lines.append(f"{counted(failed, 'table')} failed; --resume tries them again")
    if len(outcomes) < now:
        lines.append(f"{counted(now - len(outcomes), 'table')} left; continue with --resume")
    click.echo("\n".join([*lines, f"wall time {seconds:.2f} s"]), err=True)


def _shards(source: str, output: str | None, ending: str) -> dict[str, Path]:
    """Return the shard of each table."""
    if output is None or output == "-" or (os.path.exists(output) and not os.path.isdir(output)):
        raise click.UsageError("several tables need a folder for their shards: -o FOLDER")
    pattern = os.path.join(glob.escape(source), "*.parquet") if os.path.isdir(source) else source
    files = sorted(file for file in glob.glob(pattern, recursive=True) if os.path.isfile(file))
    if not files:
        advice = f"; others by a glob: '{os.path.join(source, '*.csv')}'" if os.path.isdir(source) else ""
        raise click.UsageError(f"'{pattern}' matches no table{advice}")
    shards: dict[str, Path] = {}
    taken = {os.path.realpath(file): "a table" for file in files}
    for file in files:
        stem, own = os.path.splitext(os.path.basename(file))
        shards[file] = shard = Path(output, stem + (ending or own))
        place = os.path.realpath(shard)
        if place in taken:
            raise click.UsageError(f"'{shard}', the shard of '{file}', would replace {taken[place]}")
        taken[place] = f"that of '{file}'"
    return shards


def _identity(module: str, options: dict[str, Any]) -> str:
    """Compute a digest of the command, its options, and the files of the robot but meshes."""
    about_files = ("source", "output", "jobs", "quiet")
    said = {key: repr(options[key]) for key in sorted(options) if key not in about_files}
    with recorded() as files:
        options["load"]()
    return hashlib.sha256(json.dumps([module, said, sorted(files.items())]).encode()).hexdigest()


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


def lost(module: str, options: dict[str, Any]) -> Outcome:
    """Return what became of a table that ended its process each time."""
    from ...studies.sweep.pools import MOST_DEATHS

    source = options["source"]
    times = counted(MOST_DEATHS, "time")
    return Outcome(source, error=f"{source}: its process ended without a result {times}")


def compute(module: str, options: dict[str, Any]) -> Outcome:
    """Compute one table by a command, in whatever process.

    Raises:
        OSError: The disk is full.
    """
    import logging

    from ...description.writing import FULL
    from ...threads import one_thread

    command: TableCommand = import_module(module).command
    source, out = options["source"], io.StringIO()
    log = logging.getLogger("hybridyn")
    before = log.level
    log.setLevel(logging.ERROR)  # the first process has said what looks wrong in the robot
    try:
        with (
            one_thread(), warnings.catch_warnings(), contextlib.redirect_stdout(out),
            contextlib.redirect_stderr(io.StringIO()),
        ):  # fmt: skip
            warnings.simplefilter("ignore")
            status = command.one(options | {"load": partial(_robot, repr(options["load"]), options["load"])})
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


#: The robot of the last table that this process computed, by the choice of the user.
_kept: dict[str, HybridRobot] = {}


def _robot(key: str, choice: RobotChoice) -> HybridRobot:
    """Load a robot, unless this process has just had it."""
    if key not in _kept:
        _kept.clear()
        _kept[key] = choice()
    return _kept[key]
