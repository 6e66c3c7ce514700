"""Evict least recently used libraries from the cache when it exceeds `LIMIT`.

A library's modification time is the time of its last use. A loaded library stays usable after its file is
removed. A process whose file is removed before it is loaded builds it again (`calls.loaded`). So no process
waits for another.
"""

from __future__ import annotations

import contextlib
import json
import os.path
import shutil
import time
from pathlib import Path

#: Size of the cached libraries [bytes]; the library of a robot with 24 motors has 400,000.
LIMIT = 256 * 2**20
#: Time after its last use in which a library is never removed [s].
IN_USE = 3600.0
#: Age from which unfinished files are taken to be left by a killed process [s].
ABANDONED = 86400.0


def remove_unused(at: Path) -> None:
    """Remove libraries beyond `LIMIT`, the records and keys that lead to them, and abandoned files."""
    libraries, models, room = at / "libraries", at / "models", LIMIT
    for path in sorted(libraries.glob("*.so"), key=_age_and_size):
        age, size = _age_and_size(path)
        room -= size
        if room < 0 and age > IN_USE:
            _remove(path)
    if room < 0:  # records and keys are written after their library, so none is removed too early
        for record in models.glob("*.json"):
            if not os.path.exists(libraries / f"{_target(record)}.so"):
                _remove(record)
        for key in (at / "keys").glob("[0-9a-f]*"):
            if not os.path.exists(models / f"{_target(key)}.json"):
                _remove(key)
    for path in [*at.glob("building-*"), *at.glob("*/tmp*")]:
        if _age_and_size(path)[0] > ABANDONED:
            shutil.rmtree(path, ignore_errors=True)
            _remove(path)


def _target(path: Path) -> str:
    """Return the name that a record or a key leads to; empty if its content is invalid."""
    try:
        text = path.read_text()
        return str(json.loads(text)["library"]) if path.suffix else text
    except (OSError, ValueError, KeyError, TypeError):
        return ""


def _age_and_size(path: Path) -> tuple[float, int]:
    """Return the time since a file's last use [s] and its size [bytes]; zeros if it is gone."""
    try:
        stat = path.stat()
    except OSError:
        return 0.0, 0
    return time.time() - stat.st_mtime, stat.st_size


def _remove(path: Path) -> None:
    with contextlib.suppress(OSError):
        path.unlink()
