"""Whose files the cache's are: a library runs as its user, so nobody else may have written it."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from ...errors import CompileError

_INNER = ("keys", "models", "libraries")
_OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH


def check_ownership(folder: Path, variable: str) -> None:
    """Refuse a folder that belongs to somebody else, or in which others can write.

    Args:
        folder: The folder; those in it that hold libraries, and what leads to them, are looked at too.
        variable: Environment variable that names another, for the message.

    Raises:
        CompileError: It is one.
    """
    for place in (folder, *(folder / name for name in _INNER)):
        try:
            about = place.stat()
        except FileNotFoundError:  # not made yet, or the whole cache was just removed
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
    """Tell whether a file is the user's own and only theirs to write; links are followed nowhere.

    Raises:
        OSError: It is not there.
    """
    about = file.lstat()
    return stat.S_ISREG(about.st_mode) and about.st_uid == os.geteuid() and not about.st_mode & _OTHERS_WRITE
