"""How much of the cache stays: beyond `LIMIT` the libraries that were not used for longest go first.

A library's time of modification is when it was last handed out. One that is loaded stays usable after its
file is gone, and whoever finds a file gone before it is loaded builds it again (`calls.loaded`): no process
waits for another.
"""

from __future__ import annotations

import contextlib
import json
import os.path
import shutil
import time
from pathlib import Path

#: Bytes of libraries that are kept; one of a robot of 24 motors has 400,000.
LIMIT = 256 * 2**20
#: Time after it was handed out in which a library is never removed [s].
IN_USE = 3600.0
#: Age from which on unfinished files are those of a process that was killed [s].
ABANDONED = 86400.0


def remove_unused(at: Path) -> None:
    """Remove what is beyond `LIMIT`, what led there, and what was never finished.

    Args:
        at: The cache's folder.
    """
    libraries, models, room = at / "libraries", at / "models", LIMIT
    for path in sorted(libraries.glob("*.so"), key=_age_and_size):
        age, size = _age_and_size(path)
        room -= size
        if room < 0 and age > IN_USE:
            _remove(path)
    if room < 0:  # what leads to a library is written after it
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
    """Return the name that a record or a key leads to; none where it holds something else."""
    try:
        text = path.read_text()
        return str(json.loads(text)["library"]) if path.suffix else text
    except (OSError, ValueError, KeyError, TypeError):
        return ""


def _age_and_size(path: Path) -> tuple[float, int]:
    """Return the time since a file was used [s] and its bytes; what is gone is young."""
    try:
        stat = path.stat()
    except OSError:
        return 0.0, 0
    return time.time() - stat.st_mtime, stat.st_size


def _remove(path: Path) -> None:
    with contextlib.suppress(OSError):
        path.unlink()
