"""Serve requests for USD files: a line of JSON each; the reply is a line with a size, and so many bytes.

The request has "file", "folders" (real paths that layers may be in), "largest" [bytes], "memory" [bytes],
"seconds" and "most" (prims). The reply's bytes are JSON: the dump, or "error" with "file" and "line".
"""

from __future__ import annotations

import json
import os
import resource
import select
import sys
from typing import Any, BinaryIO

from .dumping import dump, warm_up
from .layers import RefusedError, open_stage, refusal

#: Time without a request after which the server ends [s].
IDLE = 30


def main() -> None:
    """Serve requests until the parent closes the pipe, or nothing comes for a while."""
    requests, replies = sys.stdin.buffer, sys.stdout.buffer
    warm_up()
    while select.select([requests], [], [], IDLE)[0]:
        line = requests.readline()
        if not line:
            return
        text, status = _in_a_fork(json.loads(line))
        replies.write(json.dumps({"size": len(text), "status": status}).encode() + b"\n" + text)
        replies.flush()


def _in_a_fork(request: dict[str, Any]) -> tuple[bytes, int]:
    """Return the reply's text from a forked process, and how the process ended."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reading)
        with os.fdopen(writing, "wb") as pipe:
            _answer(request, pipe)
        os._exit(0)
    os.close(writing)
    with os.fdopen(reading, "rb") as pipe:
        text = pipe.read()
    _, status = os.waitpid(child, 0)
    return text, os.waitstatus_to_exitcode(status)


def _answer(request: dict[str, Any], pipe: BinaryIO) -> None:
    """Write the dump of a file, or the error, as JSON."""
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_CPU, (request["seconds"], request["seconds"]))
    _limit_memory(request["memory"])
    try:
        stage = open_stage(request["file"], request["folders"], request["largest"])
        answer = dump(stage, request["most"])
    except RefusedError as error:
        answer = {"error": str(error), "file": error.file, "line": error.line}
    except MemoryError:
        answer = {"error": "needs too much memory", "file": None, "line": None}
    except Exception as error:
        answer = {"error": str(refusal(error)), "file": None, "line": None}
    pipe.write(json.dumps(answer).encode())


def _limit_memory(memory: int) -> None:
    """Limit the address space, where the system can."""
    try:
        resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    except (OSError, ValueError):
        return
