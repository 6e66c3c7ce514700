"""The user's cache folder, and the check of who owns its files.

A library runs with its user's rights, and a kept text stands for a robot's file, so only the user may write
them.
"""

from __future__ import annotations

import hashlib
import os
import stat
import sys
from pathlib import Path

from ..errors import CompileError

#: Environment variable that sets another cache folder.
VARIABLE = "HYBRIDYN_CACHE"

_INNER = ("keys", "models", "libraries", "texts")
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
    digest = hashlib.sha256()
    for text in texts:
        digest.update(text.encode(errors="surrogateescape"))
        digest.update(b"\0")
    return digest.hexdigest()[:40]


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
