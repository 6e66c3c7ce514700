"""What a process of OpenUSD may do instead of an answer; it imports this file."""

import os
import time

from hybridyn.description.usd.worker import end_after


def abort(*_: object) -> bytes:
    """End like a crash in C++."""
    os.abort()


def hang(*_: object) -> bytes:
    """Wait without processor time, for longer than a file with a limit of one second may take."""
    end_after(1)
    time.sleep(1000)
    return b""
