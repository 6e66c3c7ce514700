"""Settings of the C library's memory for processes that allocate and free many large arrays."""

from __future__ import annotations

import ctypes
import sys

_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3  # glibc's names for mallopt


def keep_freed_memory() -> None:
    """Make the C library keep freed memory for the next array instead of returning it to the system.

    By default glibc maps new memory for each large array, and half the time of a table is spent on page
    faults. With other C libraries this function does nothing.
    """
    if not sys.platform.startswith("linux"):
        return
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(_MMAP_THRESHOLD, 2**25)
        mallopt(_TRIM_THRESHOLD, 2**31 - 1)
