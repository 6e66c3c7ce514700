"""What the process does in which OpenUSD opens files: limits, and the prims of a file as text.

OpenUSD is C++ and reads binary files, so a hostile file could end the process or fill its memory.
"""

from __future__ import annotations

import json
import os
import resource
import signal
import threading
import time
from collections.abc import Sequence
from multiprocessing import parent_process
from typing import Any

#: Longest text of the prims of a file [bytes].
LONGEST = 512 * 2**20


def begin(memory: int) -> None:
    """Limit this process, before it imports OpenUSD. `memory`: most memory that it may take [bytes]."""
    os.environ.clear()  # plugins and search paths come from it
    os.environ["PXR_WORK_THREAD_LIMIT"] = "1"
    os.chdir("/")
    nothing = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(nothing, stream)
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    _limit(resource.RLIMIT_AS, memory)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def read_stage(file: str, folders: Sequence[str], largest: int, most: int, seconds: int) -> bytes:
    """Return the prims of a file, or why it is refused ("error", "file", "line"), as JSON.

    Args:
        file: Path of the file.
        folders: Real paths of the folders in which layers may be.
        largest: Largest size of all layers together [bytes].
        most: Most prims.
        seconds: Processor time that it may take, see `end_after`.
    """
    end_after(seconds)
    answer: dict[str, Any]
    try:
        from .dumping import dump
        from .layers import RefusedError, open_stage, refusal
    except ImportError as error:
        answer = {"error": f"OpenUSD cannot be imported: {error}", "file": None, "line": None}
        return json.dumps(answer).encode()
    try:
        answer = dump(open_stage(file, folders, largest), most)
    except RefusedError as error:
        answer = {"error": str(error), "file": error.file, "line": error.line}
    except MemoryError:
        answer = {"error": "needs too much memory", "file": None, "line": None}
    except Exception as error:
        answer = {"error": str(refusal(error)), "file": None, "line": None}
    text = json.dumps(answer).encode()
    signal.alarm(0)
    if len(text) > LONGEST:
        return json.dumps({"error": "has too many values", "file": None, "line": None}).encode()
    return text


def end_after(seconds: int) -> None:
    """Let this process end after some more processor time [s], and after twice this time in any case."""
    _limit(resource.RLIMIT_CPU, int(time.process_time()) + seconds)
    signal.alarm(2 * seconds)


def _limit(what: int, soft: int) -> None:
    """Set a limit of this process, where the system can."""
    try:
        resource.setrlimit(what, (soft, resource.getrlimit(what)[1]))
    except (OSError, ValueError):
        return


def _end_with_parent() -> None:
    """End this process when the one that started it was killed, and cannot ask it to end."""
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
