"""Open a USD file in a child process, which sends its prims as plain data.

One child serves many files: importing OpenUSD takes half a second. It forks for each file, so neither a crash
nor the memory of one file concerns the next.
"""

from __future__ import annotations

import atexit
import contextlib
import importlib.util
import json
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ...errors import ModelError, install_advice
from ..files_read import record
from ..urdf.xml_node import LARGEST_FILE
from .stage import Stage

#: Memory that a file may take [bytes].
MEMORY = 2 * 2**30

#: Processor time that a file may take [s]; a robot of 10,000 links takes 10 s.
SECONDS = 120

#: Time after which the child is killed [s]; it is longer, because the child may wait for a processor.
PATIENCE = 2 * SECONDS

#: Most prims of a file.
MOST_PRIMS = 100_000

#: Longest reply [bytes].
LARGEST_REPLY = 512 * 2**20

#: Program of the child; its folder is on the path only while its own modules are imported.
START = """
import sys
sys.path[:0] = [sys.argv[1], sys.argv[2]]
from usd_child.main import main
del sys.path[:2]
main()
"""


def open_usd(file: str, package_dirs: Sequence[str | os.PathLike[str]] = ()) -> Stage:
    """Open a USD file with the layers that it names.

    Args:
        file: Path of the file.
        package_dirs: Folders, beside the robot's own, in which layers may be.

    Raises:
        ModelError: usd-core is not installed, OpenUSD refuses the file, the file names layers elsewhere, or
            it takes too much time or memory.
    """
    path = os.path.abspath(file)
    own = {os.path.dirname(path), os.path.dirname(os.path.realpath(path))}
    request = {
        "file": path,
        "folders": sorted(os.path.realpath(folder) for folder in (*own, *package_dirs)),
        "largest": LARGEST_FILE,
        "memory": MEMORY,
        "seconds": SECONDS,
        "most": MOST_PRIMS,
    }
    answer = _asked(file, request)
    if "error" in answer:
        inner = answer["file"]
        where = file if inner in (None, path) or not os.path.exists(inner) else os.path.relpath(inner)
        raise ModelError(str(answer["error"]), file=where, line=answer["line"])
    return Stage(file, answer)


def _asked(file: str, request: dict[str, Any]) -> dict[str, Any]:
    """Return the child's answer to a request."""
    with _LOCK:
        for last in (False, True):
            server = _server(file)
            try:
                header, text = server.ask(request)
                break
            except (OSError, ValueError):
                server.close()  # it has ended because nothing came for a while, or was killed
                if last or server.late:
                    raise ModelError(_reason(-signal.SIGKILL), file=file) from None
            except BaseException:
                server.close()  # interrupted: its answer must not be taken for that of the next file
                raise
    if header["status"] or not text:
        raise ModelError(_reason(header["status"]), file=file)
    record(f"{request['file']}/stage", text)  # with all layers, which only the child reads
    answer: dict[str, Any] = json.loads(text)
    return answer


def _reason(status: int) -> str:
    """Return the reason why a process ended without an answer."""
    if status in (-signal.SIGKILL, -signal.SIGXCPU):
        return f"took more than {SECONDS} s of processor time in OpenUSD and was ended"
    return (
        f"OpenUSD ended while it read the file (status {status}); the file is damaged, or needs more than "
        f"{MEMORY // 2**30} GiB of memory"
    )


class _Server:
    """The child process.

    Attributes:
        pid: The process that started it; another one, a fork of it, starts its own.
        late: Whether it was killed because a file took too long.
    """

    def __init__(self, file: str) -> None:
        self.pid, self.late = os.getpid(), False
        command = [sys.executable, "-I", "-S", "-X", "utf8", "-c", START]
        folders = [str(Path(__file__).parent), _folder_of_usd(file)]
        environment = {"PXR_WORK_THREAD_LIMIT": "1"}  # nothing else: plugins and search paths come from it
        try:
            self._child = subprocess.Popen(
                [*command, *folders], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL, env=environment, cwd="/", start_new_session=True,
            )  # fmt: skip
        except OSError as error:
            raise ModelError(f"USD: no child process could be started: {error.strerror}", file=file) from None

    def ask(self, request: dict[str, Any]) -> tuple[dict[str, Any], bytes]:
        """Return the header and the text of the answer.

        Raises:
            OSError: The child has ended.
            ValueError: It sent no answer.
        """
        assert self._child.stdin is not None
        assert self._child.stdout is not None
        watch = threading.Timer(PATIENCE, self._kill)
        watch.daemon = True
        watch.start()
        try:
            self._child.stdin.write(json.dumps(request).encode() + b"\n")
            self._child.stdin.flush()
            header = json.loads(self._child.stdout.readline(1000))
            if header["size"] > LARGEST_REPLY:
                raise ValueError("the answer is too long")
            return header, self._child.stdout.read(header["size"])
        finally:
            watch.cancel()

    def is_running(self) -> bool:
        """Return whether this process started it, and it has not ended."""
        return self.pid == os.getpid() and self._child.poll() is None

    def _kill(self) -> None:
        self.late = True
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self._child.pid, signal.SIGKILL)

    def close(self) -> None:
        """End the child and the process that it forked."""
        if self.pid != os.getpid():
            return
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(self._child.pid, signal.SIGKILL)
        for pipe in (self._child.stdin, self._child.stdout):
            if pipe is not None:
                with contextlib.suppress(OSError):
                    pipe.close()
        self._child.wait()


_LOCK = threading.Lock()
_RUNNING: list[_Server] = []


def _server(file: str) -> _Server:
    """Return the running child of this process, or a new one."""
    for server in _RUNNING:
        if server.is_running():
            return server
    for server in _RUNNING:
        server.close()
    _RUNNING[:] = [_Server(file), *(server for server in _RUNNING if server.pid != os.getpid())]
    return _RUNNING[0]


@atexit.register
def _close() -> None:
    for server in _RUNNING:
        server.close()


def _folder_of_usd(file: str) -> str:
    """Return the folder from which OpenUSD is imported, without importing it."""
    spec = importlib.util.find_spec("pxr")
    if spec is None or not spec.submodule_search_locations:
        advice = install_advice("usd")
        raise ModelError(f"this is USD, for which hybridyn needs the package usd-core; {advice}", file=file)
    return str(Path(next(iter(spec.submodule_search_locations))).parent)
