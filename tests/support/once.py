"""What several tests need and takes long: computed once a session, for all its workers."""

import fcntl
import functools
import hashlib
import os
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

T = TypeVar("T")

#: Environment variable that names the session's folder; the process that starts the workers sets it.
VARIABLE = "HYBRIDYN_TESTS_FOLDER"


def folder() -> Path:
    """Return the folder that all processes of this session share."""
    return Path(os.environ[VARIABLE])


def once(name: str, make: Callable[[], T]) -> T:
    """Return what `make` gives, which is called by one process only.

    Args:
        name: What it is, a file's name.
        make: Makes it; the answer must travel by pickle.
    """
    with open(folder() / f"{name}.lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        path = folder() / f"{name}.pickle"
        if not path.exists():
            path.write_bytes(pickle.dumps(make()))
    return _read(path)  # type: ignore[no-any-return]


def kept(make: Callable[[], T], *asked: object) -> T:
    """Return what `make` gives for what is asked, made once a session; outside of one, make it.

    Args:
        make: Makes it; the answer must travel by pickle, and its reader must not change it.
        asked: All that the answer depends on, the maker's name among it.
    """
    if VARIABLE not in os.environ:
        return make()
    return once(hashlib.sha256(pickle.dumps(asked)).hexdigest(), make)


@functools.lru_cache(maxsize=64)
def _read(path: Path) -> object:
    return pickle.loads(path.read_bytes())
