"""Keep what is slow to compute from robot files in the cache folder: texts, checked tables, postures.

An entry is JSON, named by a hash of all that it depends on. Entries are data and are never run. They are kept
and read only in a folder that the user alone can write (`cache_folder`); where there is none, every text is
computed again.
"""

from __future__ import annotations

import contextlib
import importlib.util
import json
import os
import zlib
from functools import cache
from pathlib import Path
from typing import Any

from ..errors import CompileError
from .cache_folder import check_ownership, folder, is_own
from .writing import appearing

#: Most entries of a folder that are kept; those used least recently are removed.
MOST_ENTRIES = 100
#: Largest entry that is kept, compressed [bytes]; that of 300 six-legged modules.
LARGEST_ENTRY = 2**20
#: Folder of texts.
TEXTS = "texts"


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
        entries = sorted(place.iterdir(), key=lambda path: -path.lstat().st_mtime)
        for path in entries[MOST_ENTRIES:]:
            path.unlink(missing_ok=True)


@cache
def state_of(package: str) -> str:
    """Return names, sizes and times of a package's Python files, which change with their content."""
    found = importlib.util.find_spec(package)
    with os.scandir(Path((found and found.origin) or "").parent) as entries:
        files = [(entry.name, entry.stat()) for entry in entries if entry.name.endswith(".py")]
    return " ".join(f"{name} {about.st_size} {about.st_mtime_ns}" for name, about in sorted(files))
