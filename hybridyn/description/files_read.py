"""The files from which a robot was read: its own file, and all that it includes."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

#: Digest of each file that was read, by its path, while they are recorded.
_recorded: ContextVar[dict[str, str] | None] = ContextVar("files_read", default=None)


@contextmanager
def recorded() -> Iterator[dict[str, str]]:
    """Record the robot files that are read, also by an expansion of xacro that is kept.

    Yields:
        Digest of each file, by its absolute path.
    """
    found: dict[str, str] = {}
    token = _recorded.set(found)
    try:
        yield found
    finally:
        _recorded.reset(token)


def record(path: str | os.PathLike[str], content: bytes) -> None:
    """Record a file that was read."""
    found = _recorded.get()
    if found is not None:
        found[os.path.abspath(path)] = hashlib.sha256(content).hexdigest()
