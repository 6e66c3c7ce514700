"""Commands that compute a table, for many tables: a folder or a glob, in several processes, a shard each."""

from __future__ import annotations

import glob
import hashlib
import json
import os
import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ...description.urdf.robot_folders import recorded
from ...description.writing import locked, write_text
from ...errors import HybridynError
from .one_table import Outcome, compute, lost
from .options import RobotChoice
from .progress import Progress
from .text import counted

if TYPE_CHECKING:
    from ...studies.sweep.pools import PoolName
    from .tables import TableCommand

#: The file that says what the shards of a folder are: a digest of the command, then for each table that was
#: computed a line with the digests of table and shard.
ABOUT = "tables.txt"
#: Errors that are printed; the others are counted.
MOST_PRINTED = 20
#: Exit status where a table failed.
FAILED = 1


def several(word: str) -> bool:
    """Return whether a word names several tables: it is a folder, or a pattern and no file."""
    return os.path.isdir(word) or (glob.has_magic(word) and not os.path.exists(word))


class Batch:
    """The tables of a command, and the folder of their shards."""

    def __init__(self, command: TableCommand, options: dict[str, Any], ending: str) -> None:
        """Start without results.

        Args:
            command: The command that computes a table.
            options: Its options; `source` names the tables.
            ending: Ending of the shards; "" takes that of the table.
        """
        assert command.callback is not None
        self.module, self.options, self.ending = command.callback.__module__, options, ending
        self.failed: list[Outcome] = []
        self.texts: dict[str, str] = {}
        self.status = self.done = 0

    def run(self, pool: PoolName, scheduler: str | None, *, resume: bool) -> int:
        """Compute every table that has no shard, and return the exit status.

        Raises:
            HybridynError: No table is found, the robot does not load, the folder has other results, or the
                scheduler does not answer.
            OSError: The disk is full; the shards so far are complete.
        """
        from ...studies.sweep.pools import check_pool, open_pool

        started = time.perf_counter()
        for name in ("plot", "reactions"):
            if self.options.get(name):
                raise click.UsageError(f"--{name} belongs to a single table")
        check_pool(pool, scheduler)
        shards = self._shards()
        folder = Path(self.options["output"])
        self.options["load"]()  # a robot that does not load is one error, and not one for each table
        with locked(folder):
            left = _begin(folder, self._identity(), shards, resume=resume)
            far = scheduler is not None
            tasks = [(self.module, self._of_one(file, shards[file], elsewhere=far)) for file in left]
            try:
                if left:
                    with (
                        open_pool(pool, self.options["jobs"], scheduler) as processes,
                        Progress("tables") as bar,
                    ):
                        for outcome in processes.run(compute, tasks, lost):
                            self._take(outcome, folder, left[outcome.source], shards[outcome.source])
                            bar.show(self.done, self.done / len(left))
            finally:
                self._report(shards, len(left), folder, started)
        return FAILED if self.failed else self.status

    def _take(self, outcome: Outcome, folder: Path, digest: str, shard: Path) -> None:
        """Count a table, print its error, and record its shard."""
        self.done += 1
        self.status = max(self.status, outcome.status)
        if outcome.error:
            self.failed.append(outcome)
            if len(self.failed) <= MOST_PRINTED:
                click.echo(f"error: {outcome.error}", err=True)
        elif outcome.text:
            self.texts[outcome.source] = outcome.text
        if not outcome.error and shard.exists():
            with open(folder / ABOUT, "a", encoding="utf-8") as record:
                record.write(_line(digest, shard))

    def _report(self, shards: dict[str, Path], now: int, folder: Path, started: float) -> None:
        """Print what the commands printed, in the order of the tables, and what became of the tables."""
        for source, text in sorted(self.texts.items()):
            click.echo(f"{source}:\n{text}", nl=False)
        kept = len(shards) - now
        good = self.done - len(self.failed)
        lines = [f"{counted(kept + good, 'table')} of {len(shards):,} in '{folder}', {good:,} computed now"]
        if self.failed:
            lines.append(f"{counted(len(self.failed), 'table')} failed; --resume tries them again")
        if self.done < now:
            lines.append(f"{counted(now - self.done, 'table')} left; continue with --resume")
        lines.append(f"wall time {time.perf_counter() - started:.2f} s")
        for line in lines:
            click.echo(line, err=True)

    def _shards(self) -> dict[str, Path]:
        """Return the shard of each table."""
        source, output = self.options["source"], self.options["output"]
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
            shards[file] = shard = Path(output, stem + (self.ending or own))
            place = os.path.realpath(shard)
            if place in taken:
                raise click.UsageError(f"'{shard}', the shard of '{file}', would replace {taken[place]}")
            taken[place] = f"that of '{file}'"
        return shards

    def _of_one(self, source: str, shard: Path, *, elsewhere: bool) -> dict[str, Any]:
        """Return the options of one table, with absolute paths for processes of a cluster."""
        load: RobotChoice = self.options["load"]
        own: dict[str, Any] = {"source": source, "output": str(shard), "jobs": 1}
        if elsewhere:
            own |= {name: os.path.abspath(own[name]) for name in ("source", "output")}
            folders = tuple(map(os.path.abspath, load.package_dirs))
            load = replace(load, robot=os.path.abspath(load.robot), package_dirs=folders)
        return {**self.options, **own, "load": load, "quiet": True}

    def _identity(self) -> str:
        """Compute a digest of the command, its options, and the files of the robot but meshes."""
        load: RobotChoice = self.options["load"]
        said = {key: repr(self.options[key]) for key in sorted(self.options)}
        for key in ("source", "output", "jobs", "quiet"):
            said.pop(key, None)
        digest = hashlib.sha256(json.dumps([self.module, said]).encode())
        with recorded() as files:
            load()
        digest.update(json.dumps([files[path] for path in sorted(files)]).encode())
        return digest.hexdigest()


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
