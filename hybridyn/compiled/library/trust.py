"""Check who owns the cache's files: a library runs with its user's rights, so only the user may write it."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from ...errors import CompileError

_INNER = ("keys", "models", "libraries")
_OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH


def check_ownership(folder: Path, variable: str) -> None:
    """Check that the cache folder belongs to the user and that nobody else can write in it.

    Args:
        folder: The folder; its folders of keys, models and libraries are checked too.
        variable: Environment variable that sets another folder, for the message.

    Raises:
        CompileError: A folder belongs to another user, or others can write in it; or anybody can rename a
            folder above it, and put another one in its place.
    """
    for place in folder.resolve().parents:
        mode = place.stat().st_mode
        if mode & stat.S_IWOTH and not mode & stat.S_ISVTX:
            raise CompileError(
                f"anybody can replace the cache folder '{folder}', since others can write in '{place}': run "
                f"chmod o-w '{place}', or name another folder in {variable}"
            )
    for place in (folder, *(folder / name for name in _INNER)):
        try:
            about = place.stat()
        except FileNotFoundError:  # not created yet, or the whole cache was just removed
            continue
        if about.st_uid != os.geteuid():
            raise CompileError(
                f"the cache folder '{place}' belongs to another user, whose libraries would run as yours: "
                f"name a folder of your own in {variable}"
            )
        if about.st_mode & _OTHERS_WRITE:
            raise CompileError(
                f"others can write in the cache folder '{place}', and their libraries would run as yours: "
                f"run chmod go-w '{place}', or name another in {variable}"
            )


def is_own(file: Path) -> bool:
    """Return whether a file belongs to the user and nobody else can write it; links are not followed.

    Raises:
        OSError: The file does not exist.
    """
    about = file.lstat()
    return stat.S_ISREG(about.st_mode) and about.st_uid == os.geteuid() and not about.st_mode & _OTHERS_WRITE
