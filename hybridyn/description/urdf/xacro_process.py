"""The child process of xacro: one for each expansion, or one that is kept for many and forks for each.

Most of an expansion's time is the start of Python and the import of xacro, which a kept child does once. Each
expansion then has a fork of its own, restricted as a child for one file is, so that nothing of an expansion
reaches the next.
"""

from __future__ import annotations

import atexit
import contextlib
import os
import signal
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from ...errors import ModelError

if TYPE_CHECKING:
    import subprocess

#: Processor time that an expansion may use [s]; a stack of 1,000 six-legged modules takes 40 s.
SECONDS = 120

#: Time after which an expansion is killed [s]; it is longer, because the child may wait for a processor.
PATIENCE = 2 * SECONDS

#: Program of the child; its folder is on the path only while its own modules are imported.
START = """
import sys
sys.path.insert(0, sys.argv[1])
from xacro_child.main import main
del sys.path[0]
main()
"""


class _Kept:
    """Whether a child is kept, and the child, once it has started."""

    def __init__(self) -> None:
        self.wanted = False
        self.child: subprocess.Popen[bytes] | None = None
        self.lock = threading.Lock()


_kept = _Kept()


def keep_child() -> None:
    """Keep one child for all expansions of this process, until `drop_child`."""
    _kept.wanted = hasattr(os, "fork")


def drop_child() -> None:
    """End the child that is kept."""
    _kept.wanted = False
    with _kept.lock:
        _end_kept()


def is_kept() -> bool:
    """Return whether one child is kept for all expansions."""
    return _kept.wanted


@contextlib.contextmanager
def child_of(file: str, *, kept: bool) -> Iterator[subprocess.Popen[bytes]]:
    """Yield a child that waits for a request; end it at the latest after `PATIENCE`.

    A child that is kept ends only on an error. It must have sent its whole answer otherwise.

    Args:
        file: The file to expand, for messages.
        kept: Whether it is the child that is kept for all expansions.

    Raises:
        ModelError: No process can be started.
    """
    if not kept:
        with _start(file) as child:
            try:
                with _watched(child):
                    yield child
            finally:
                _kill(child)
        return
    with _kept.lock:
        if _kept.child is not None and _kept.child.poll() is not None:  # killed while it waited
            _end_kept()
        child = _kept.child = _kept.child or _start(file)
        try:
            with _watched(child):
                yield child
        except BaseException:
            _end_kept()
            raise


def _start(file: str) -> subprocess.Popen[bytes]:
    """Start a child, in a process group of its own, to which its forks belong.

    Its pipes are not buffered: a fork of this process would copy the lock and the content of a buffer that
    another thread is using.

    It writes no bytecode (-B): on a full disk, or under a limit on file sizes, Python leaves truncated files
    behind, and every later expansion would fail.
    """
    import subprocess  # an expansion that is kept needs no child

    command = [sys.executable, "-B", "-I", "-S", "-X", "utf8", "-c", START, str(Path(__file__).parent)]
    try:
        return subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env={},
            process_group=0, bufsize=0,
        )  # fmt: skip
    except OSError as error:
        raise ModelError(f"xacro: no child process could be started: {error.strerror}", file=file) from None


@contextlib.contextmanager
def _watched(child: subprocess.Popen[bytes]) -> Iterator[None]:
    """Kill a child that is not done after `PATIENCE`."""
    watch = threading.Timer(PATIENCE, _kill, [child])
    watch.daemon = True
    watch.start()
    try:
        yield
    finally:
        watch.cancel()


def _kill(child: subprocess.Popen[bytes]) -> None:
    """Kill a child and its forks."""
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(child.pid, signal.SIGKILL)
    child.kill()


def _end_kept() -> None:
    """End the kept child, if it has started."""
    child, _kept.child = _kept.child, None
    if child is not None:
        _kill(child)
        with contextlib.suppress(BrokenPipeError):
            child.__exit__(None, None, None)


def _forget() -> None:
    """In a fork of this process: leave the child to the process that started it."""
    _kept.child, _kept.lock = None, threading.Lock()


atexit.register(drop_child)
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget)
