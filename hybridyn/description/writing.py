"""Write a file that appears when it is complete; name it in the errors of a full disk."""

from __future__ import annotations

import contextlib
import errno
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

#: Errors that only writing causes, and that the system reports without the name of the file.
FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}


@contextlib.contextmanager
def naming(target: str | os.PathLike[str]) -> Iterator[None]:
    """Add the name of a file to the error that reports no space for it on the disk.

    Args:
        target: The file being written.

    Raises:
        OSError: There is no space left; the error names the file.
    """
    try:
        yield
    except OSError as error:
        if error.errno in FULL and error.filename is None:
            raise OSError(error.errno, error.strerror, os.fspath(target)) from None
        raise


def write_text(path: Path, text: str) -> None:
    """Write a text file, which replaces an existing one when it is complete and keeps its permissions.

    Args:
        path: The file.
        text: Its content.

    Raises:
        OSError: The file cannot be written.
    """
    with naming(path):
        handle, new = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
        try:
            with os.fdopen(handle, "w", encoding="utf-8", newline="") as file:
                file.write(text)
            os.chmod(new, path.stat().st_mode & 0o777 if path.exists() else 0o644)
            os.replace(new, path)
        except BaseException:
            os.unlink(new)
            raise
