"""Writing files: an error of a full disk names the file that was being written."""

from __future__ import annotations

import contextlib
import errno
import os
from collections.abc import Iterator

#: Errors that come from writing alone, and that the system reports without a file's name.
FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}


@contextlib.contextmanager
def naming(target: str | os.PathLike[str]) -> Iterator[None]:
    """Put the name of a file into the errors of a disk that has no room for it.

    Args:
        target: The file that is written.

    Raises:
        OSError: There is no room; the file is named.
    """
    try:
        yield
    except OSError as error:
        if error.errno in FULL and error.filename is None:
            raise OSError(error.errno, error.strerror, os.fspath(target)) from None
        raise
