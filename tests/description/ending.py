"""What a process of OpenUSD may do instead of an answer; it imports this file."""

import os
import signal
import time


def abort(*_: object) -> bytes:
    """End like a crash in C++."""
    os.abort()


def hang(*_: object) -> bytes:
    """Wait for longer than a file with a limit of one second may take."""
    signal.alarm(1)
    time.sleep(1000)
    return b""
