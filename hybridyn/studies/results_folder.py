"""Folders of results, which one process writes: a record of what was asked, and parts that are there or not.

The record's first line is JSON: what was asked, as digests by name, and what its owner tells. Each other line
is a part: a digest of its bytes and of what it was computed from, and its name. A file with other bytes is no
part. A part is recorded before it appears, so that no part appears without its line.
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import json
import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..description.names import listed
from ..description.writing import appearing, write_text
from ..errors import HybridynError

#: The file that says what the parts of a folder are.
RECORD = "record.txt"
#: How the drafts of parts begin, and the pattern of their names and of those of their own drafts.
DRAFT = "hybridyn-part"
DRAFTS = f".*{DRAFT}.{'[0-9a-f]' * 16}.*"
#: The file that the process holds which writes in a folder.
LOCK = "writing.lock"


@dataclass(frozen=True)
class Record:
    """What the parts of a folder belong to.

    Attributes:
        folder: The folder.
        asked: What was asked: a digest, or a text, by name.
        told: What else its owner has to know of the parts.
        parts: Digests of each part and of its source, by its name.
    """

    folder: Path
    asked: Mapping[str, str]
    told: Mapping[str, Any]
    parts: Mapping[str, str]

    def has(self, name: str, of: str = "") -> bool:
        """Return whether a part is there. `of`: digest of what else than asked it is computed from."""
        there = (self.folder / name).is_file()
        return there and self.parts.get(ascii(name)) == digest(self.folder / name) + of

    @property
    def begun(self) -> bool:
        """Whether there is a file with the name of a part."""
        return any(ascii(file.name) in self.parts for file in self.folder.glob("*"))


def read_record(folder: str | os.PathLike[str]) -> Record:
    """Read the record of a folder; an empty one where there is none."""
    try:
        first, *lines = Path(folder, RECORD).read_text(encoding="utf-8").splitlines()
        parts = (line.partition(" ") for line in lines)
        return Record(Path(folder), **json.loads(first), parts={name: found for found, _, name in parts})
    except (OSError, ValueError, TypeError):
        return Record(Path(folder), {}, {}, {})


@contextlib.contextmanager
def writing(
    folder: str | os.PathLike[str], asked: Mapping[str, str], told: Mapping[str, Any], names: Iterable[str],
    *, resume: bool,
) -> Iterator[Record]:  # fmt: skip
    """Begin or continue the results in a folder, hold it for this process, and yield its record.

    The end of the process releases the folder, whatever ends it.

    Args:
        folder: The folder, which is made if it does not exist.
        asked: What is asked: a digest, or a text, by name; "command" is who asks.
        told: What else to record; where the folder has parts, theirs stays.
        names: Patterns of the names of parts, and of what would be taken for one.
        resume: Whether to continue from parts that exist.

    Raises:
        HybridynError: The folder has parts and `resume` is false, or they were computed with something else;
            it has files with the names of parts, but no record of them; another process holds the folder, or
            it is no folder.
        OSError: It cannot be made or written to.
    """
    if os.path.exists(folder) and not os.path.isdir(folder):
        raise HybridynError(f"{folder}: is not a folder")
    os.makedirs(folder, exist_ok=True)
    with open(Path(folder, LOCK), "a") as held:
        try:
            fcntl.flock(held, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise HybridynError(
                f"{folder}: another process writes its results here: wait for its end, or choose another "
                "folder"
            ) from None
        record = _begun(read_record(folder), asked, told, names, resume)
        _remove_drafts(record.folder)
        try:
            yield record
        finally:
            _remove_drafts(record.folder)


def _remove_drafts(folder: Path) -> None:
    """Remove the drafts of processes that were killed from a folder that is held."""
    for draft in folder.glob(DRAFTS):
        draft.unlink(missing_ok=True)


def _begun(
    before: Record, asked: Mapping[str, str], told: Mapping[str, Any], names: Iterable[str], resume: bool
) -> Record:
    """Begin or continue the results in a folder that is held, and return its record."""
    files = (file.name for name in names for file in before.folder.glob(name))
    if unknown := sorted(file for file in files if ascii(file) not in before.parts):
        raise HybridynError(
            f"{before.folder}: has {listed(unknown)}, of which it has no record: choose another folder, or "
            "remove them"
        )
    if not before.begun:
        write_text(before.folder / RECORD, json.dumps({"asked": asked, "told": told}))
        return Record(before.folder, asked, told, {})
    if before.asked.get("command") != asked.get("command"):
        raise HybridynError(f"{before.folder}: has results of another command: choose another folder")
    if other := [one for one in {**before.asked, **asked} if before.asked.get(one) != asked.get(one)]:
        raise HybridynError(
            f"{before.folder}: its results were computed with another {listed(other)}: undo the change, or "
            "choose another folder"
        )
    if not resume:
        raise HybridynError(
            f"{before.folder}: has results of an earlier run: continue it with resume=True, or choose "
            "another folder"
        )
    return before


@contextlib.contextmanager
def part(folder: Path, name: str, of: str = "", asked: Mapping[str, str] | None = None) -> Iterator[Path]:
    """Yield the path of a draft, which becomes a part of the results at the end, or is removed on any error.

    Args:
        folder: A folder that is being written (`writing`), also by the process that started this one.
        name: Name of the part.
        of: Digest of what else than asked it is computed from.
        asked: What was asked of a process that may outlive the one that holds the folder; None for that one.

    Raises:
        HybridynError: Something else has been asked since, or the record is gone.
        OSError: The disk is full, or the folder is gone; the error names the part.
    """
    with appearing(folder / name, DRAFT) as draft:
        yield draft
        if asked not in (None, read_record(folder).asked):
            raise HybridynError(f"{folder}: another run has begun here, or the record is gone")
        with open(folder / RECORD, "a", encoding="utf-8") as record:
            record.write(f"\n{digest(draft)}{of} {name!a}")  # after a line that a full disk cut


def digest(path: str | os.PathLike[str]) -> str:
    """Compute the digest of a file."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def by_name(files: Mapping[str, str]) -> dict[str, str]:
    """Return digests of files by their names without folders, so that all of them may move together."""
    names = {path: os.path.basename(path) for path in sorted(files)}
    return {name: "".join(files[path] for path in names if names[path] == name) for name in names.values()}
