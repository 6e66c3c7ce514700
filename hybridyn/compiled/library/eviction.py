"""How much of the cache stays: beyond `LIMIT` the libraries that were not used for longest go first.

A library's time of modification is when it was last handed out. Whoever hands one out sets that time and
reads the file under a lock that those who remove do not share, so what was just handed out is never old. A
library that is loaded stays usable after its file is gone.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import shutil
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

LIMIT = 256 * 2**20
"""Bytes of libraries that are kept; one of a robot of 24 motors has 400,000."""

IN_USE = 3600.0
"""Time after it was handed out in which a library is never removed [s]."""

ABANDONED = 86400.0
"""Age from which on unfinished files are those of a process that was killed [s]."""

PATIENCE, PAUSE = 5.0, 0.01
"""Longest wait for the lock, and time between two tries [s]."""


@contextlib.contextmanager
def handing_out(at: Path, library: Path) -> Iterator[None]:
    """Keep a library, if it is there, while it is read and for some time after.

    Args:
        at: The cache's folder.
        library: The library's file.
    """
    with _lock(at, fcntl.LOCK_SH):
        with contextlib.suppress(OSError):  # it is not there, or another user's
            os.utime(library)
        yield


def remove_unused(at: Path) -> None:
    """Remove what is beyond `LIMIT`, what led there, and what was never finished.

    Args:
        at: The cache's folder.
    """
    with _lock(at, fcntl.LOCK_EX) as alone:
        if not alone:  # whoever holds it removes too, or the next build will
            return
        _remove_libraries(at / "libraries")
        drafts = (path for name in ("keys", "models", "libraries") for path in (at / name).glob("tmp*"))
        for path in [*at.glob("building-*"), *drafts]:  # others' builds come and go: do not look into them
            if _age(path) > ABANDONED:
                shutil.rmtree(path, ignore_errors=True)
                _remove(path)


def _remove_libraries(folder: Path) -> None:
    """Remove the libraries beyond `LIMIT`, and the records and keys of libraries that are gone."""
    libraries = sorted(folder.glob("*.so"), key=_age)
    room = LIMIT
    for path in libraries:
        room -= _size(path)
        if room < 0 and _age(path) > IN_USE:
            _remove(path)
    if room < 0:  # what leads to a library is written after it
        models, keys = folder.with_name("models"), folder.with_name("keys")
        for record in models.glob("*.json"):
            if not (folder / f"{_library_of(record)}.so").exists():
                _remove(record)
        for key in keys.glob("[0-9a-f]*"):
            if not (models / f"{_text(key)}.json").exists():
                _remove(key)


@contextlib.contextmanager
def _lock(at: Path, kind: int) -> Iterator[bool]:
    """Hold the cache's lock, shared or alone; tells whether it was to be had in time."""
    try:
        file = os.open(at / "lock", os.O_RDWR | os.O_CREAT, 0o600)
    except OSError:
        yield False
        return
    try:
        yield _held(file, kind)
    finally:
        os.close(file)  # gives it back


def _held(file: int, kind: int) -> bool:
    """Wait for a lock, not for ever: its owner may be stopped."""
    until = time.monotonic() + PATIENCE
    while True:
        try:
            fcntl.flock(file, kind | fcntl.LOCK_NB)
            return True
        except OSError:
            if time.monotonic() > until:
                return False
            time.sleep(PAUSE)


def _library_of(record: Path) -> Any:
    try:
        return json.loads(record.read_bytes())["library"]
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _text(path: Path) -> str:
    """Return the name in a key; none where it holds something else."""
    try:
        text = path.read_text()
    except (OSError, ValueError):
        return ""
    return text if text.isalnum() else ""


def _age(path: Path) -> float:
    """Return the time since a file was used [s]; what is gone is young."""
    try:
        return time.time() - path.stat().st_mtime
    except OSError:
        return 0.0


def _size(path: Path) -> int:
    try:
        return path.stat().st_size
    except OSError:
        return 0


def _remove(path: Path) -> None:
    with contextlib.suppress(OSError):
        path.unlink()
