"""Add the name of the written file to the errors of a full disk."""

from __future__ import annotations

import contextlib
import errno
import os
from collections.abc import Iterator

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
