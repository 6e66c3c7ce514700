"""Write files that appear complete or not at all, and name full disks."""

from __future__ import annotations

import contextlib
import errno
import os
from collections.abc import Iterator
from pathlib import Path

#: Errors that only writing causes, and that the system reports without the name of the file.
FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}


@contextlib.contextmanager
def appearing(target: str | os.PathLike[str], start: str = "") -> Iterator[Path]:
    """Yield the path of a draft that replaces a file at the end, or is removed on any error.

    The draft is beside the file and has its ending. If the target is a link, the file behind it is replaced.
    A device or a pipe is never replaced: it is its own draft.

    Args:
        target: The file.
        start: How the draft's name starts, after a dot; by default as that of the file.

    Raises:
        OSError: The file cannot be written; the error names the target and not the draft.
    """
    file = Path(os.path.realpath(target))
    if file.exists() and not file.is_file():
        with naming(target):
            yield file
        return
    # short: systems allow 255 bytes, and a draft may have one
    draft = file.with_name(f".{start or file.name[:40]}.{os.urandom(8).hex()}{file.suffix}")
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
