"""The user's cache folder, and what is slow to compute from robot files in it: texts, tables, postures.

A library runs with its user's rights, and an entry stands for a robot's file, so only the user may write
them: where there is no such folder, every text is computed again. An entry is JSON, named by a hash of all
that it depends on. Entries are data and are never run.
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib.util
import json
import os
import stat
import sys
import zlib
from functools import cache
from pathlib import Path
from typing import Any

from ..errors import CompileError
from .writing import appearing

#: Environment variable that sets another cache folder.
VARIABLE = "HYBRIDYN_CACHE"

#: Most entries of a folder that are kept; those used least recently are removed.
MOST_ENTRIES = 100
#: Largest entry that is kept, compressed [bytes]; that of 300 six-legged modules.
LARGEST_ENTRY = 2**20
#: Folder of texts.
TEXTS = "texts"

_INNER = ("keys", "libraries", "texts")
_OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH


def folder() -> Path:
    """Return the cache folder: $HYBRIDYN_CACHE, or hybridyn/compiled in the user's cache folder.

    Raises:
        CompileError: The user has no home folder, as in a container that runs under a bare number.
    """
    if named := os.environ.get(VARIABLE):
        return Path(named)
    try:
        if sys.platform == "darwin":
            base = Path.home() / "Library" / "Caches"
        else:
            base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    except RuntimeError:
        raise CompileError(
            f"this user has no home folder for the cache: name a folder of your own in {VARIABLE}"
        ) from None
    return base / "hybridyn" / "compiled"


def hashed(*texts: str) -> str:
    """Return a hash of texts, as a name of a file in the cache."""
    whole = "".join(f"{text}\0" for text in texts)
    return hashlib.sha256(whole.encode(errors="surrogateescape")).hexdigest()[:40]


def check_ownership(folder: Path) -> None:
    """Check that the cache folder belongs to the user and that nobody else can write in it.

    Args:
        folder: The folder; its inner folders are checked too.

    Raises:
        CompileError: A folder belongs to another user, or others can write in it; or anybody can rename a
            folder above it, and put another one in its place.
    """
    for place in folder.resolve().parents:
        mode = place.stat().st_mode
        if mode & stat.S_IWOTH and not mode & stat.S_ISVTX:
            raise CompileError(
                f"anybody can replace the cache folder '{folder}', since others can write in '{place}': run "
                f"chmod o-w '{place}', or name another folder in {VARIABLE}"
            )
    for place in (folder, *(folder / name for name in _INNER)):
        try:
            about = place.stat()
        except FileNotFoundError:  # not created yet, or the whole cache was just removed
            continue
        if about.st_uid != os.geteuid():
            raise CompileError(
                f"the cache folder '{place}' belongs to another user, whose libraries would run as yours: "
                f"name a folder of your own in {VARIABLE}"
            )
        if about.st_mode & _OTHERS_WRITE:
            raise CompileError(
                f"others can write in the cache folder '{place}', and their libraries would run as yours: "
                f"run chmod go-w '{place}', or name another in {VARIABLE}"
            )


def is_own(file: Path) -> bool:
    """Return whether a file belongs to the user and nobody else can write it; links are not followed.

    Raises:
        OSError: The file does not exist.
    """
    about = file.lstat()
    return stat.S_ISREG(about.st_mode) and about.st_uid == os.geteuid() and not about.st_mode & _OTHERS_WRITE


def kept(name: str, at: str = TEXTS) -> Any:
    """Return an entry of a folder in the cache folder, or None if there is none that can be trusted."""
    with contextlib.suppress(OSError, ValueError, zlib.error, CompileError):
        path = folder() / at / name
        check_ownership(folder())
        if is_own(path):
            entry = json.loads(zlib.decompress(path.read_bytes()))
            os.utime(path)  # the time of its last use
            return entry
    return None


def keep(name: str, entry: Any, at: str = TEXTS) -> None:
    """Keep an entry in a folder of the cache folder; if it cannot be used, nothing is kept."""
    content = zlib.compress(json.dumps(entry).encode(), 1)
    if len(content) > LARGEST_ENTRY:
        return
    with contextlib.suppress(OSError, CompileError):
        place = folder() / at
        place.mkdir(parents=True, exist_ok=True, mode=0o700)
        check_ownership(folder())
        with appearing(place / name) as draft:
            draft.touch(0o600)
            draft.write_bytes(content)
        if len(entries := [*place.iterdir()]) > MOST_ENTRIES:
            entries.sort(key=lambda path: -path.lstat().st_mtime)
        for path in entries[MOST_ENTRIES:]:
            path.unlink(missing_ok=True)


@cache
def state_of(package: str) -> str:
    """Return names, sizes and times of a package's Python files, which change with their content."""
    found = importlib.util.find_spec(package)
    with os.scandir(Path((found and found.origin) or "").parent) as entries:
        files = [(entry.name, entry.stat()) for entry in entries if entry.name.endswith(".py")]
    return " ".join(f"{name} {about.st_size} {about.st_mtime_ns}" for name, about in sorted(files))
