"""Write files that appear complete or not at all, in folders of one process at a time; name full disks."""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
from collections.abc import Iterator
from pathlib import Path

from ..errors import HybridynError

#: Errors that only writing causes, and that the system reports without the name of the file.
FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}

#: The file in a folder of results that the process holds which writes there.
LOCK = "writing.lock"


@contextlib.contextmanager
def locked(folder: str | os.PathLike[str]) -> Iterator[None]:
    """Hold a folder, which is made if it does not exist, for this process alone; its end releases it.

    Raises:
        HybridynError: It is no folder, or another process holds it.
        OSError: It cannot be made or written to.
    """
    if os.path.exists(folder) and not os.path.isdir(folder):
        raise HybridynError(f"{folder}: is not a folder")
    os.makedirs(folder, exist_ok=True)
    with open(Path(folder, LOCK), "a") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise HybridynError(
                f"{folder}: another process writes its results here: wait for its end, or choose another "
                "folder"
            ) from None
        yield


@contextlib.contextmanager
def appearing(target: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield the path of a draft that replaces a file at the end, or is removed on any error.

    The draft is beside the file and has its ending. If the target is a link, the file behind it is replaced.
    A device or a pipe is never replaced: it is its own draft.

    Raises:
        OSError: The file cannot be written; the error names the target and not the draft.
    """
    file = Path(os.path.realpath(target))
    if file.exists() and not file.is_file():
        with naming(target):
            yield file
        return
    draft = file.with_name(f".{file.name}.{os.urandom(4).hex()}{file.suffix}")
    try:
        with naming(target):
            yield draft
            os.replace(draft, file)
    except OSError as error:
        if str(error.filename) == str(draft):
            raise OSError(error.errno, error.strerror, os.fspath(target)) from None
        raise
    finally:
        draft.unlink(missing_ok=True)


@contextlib.contextmanager
def naming(target: str | os.PathLike[str]) -> Iterator[None]:
    """Add the name of a file to the error that reports no space for it on the disk.

    Raises:
        OSError: There is no space left; the error names the file.
    """
    try:
        yield
    except OSError as error:
        if error.errno in FULL and error.filename is None:
            raise OSError(error.errno, error.strerror, os.fspath(target)) from None
        raise


def write_text(target: str | os.PathLike[str], text: str) -> None:
    """Write a text file, which appears when it is complete; a file that it replaces keeps its permissions.

    Raises:
        OSError: The file cannot be written; the error names it.
    """
    with appearing(target) as draft:
        draft.write_text(text, encoding="utf-8", newline="")
        if os.path.isfile(target):
            draft.chmod(os.stat(target).st_mode & 0o777)
