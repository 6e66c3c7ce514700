"""The library that a model uses: a quick build of one program, then of all, then the optimised one.

A process of its own writes the source of the optimised library and runs the compiler, one unit after the
other, so that the program keeps its interpreter and its other cores. The library is used only if it gives the
same bits. After the end of the program the process goes on, for at most `LEFT` seconds, and the next program
finds what it built.
"""

from __future__ import annotations

import contextlib
import fcntl
import logging
import os
import pickle
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from typing import IO

import numpy as np

from ...description.cache_folder import VARIABLE, hashed
from ...errors import CompileError, HybridynError
from .artifact import Artifact
from .cache import folder_in_use
from .calls import Calls, Library

log = logging.getLogger("hybridyn.compiled")

#: Samples on which the bits are compared: full vectors, and one that is not full.
SAMPLES = 37
#: Longest time that a build goes on after the end of its program [s]; that of the LX4 takes seven.
LEFT = 30.0
#: How much rather the processor serves the program, which may be building other libraries.
POLITE = 5
UNUSED = "the quick build stays in use: %s"
#: Program of the process, which gets the path of Python's modules.
PROGRAM = """
import sys
sys.path[:] = sys.argv[1:]
from hybridyn.compiled.library.current import build_asked
build_asked()
"""


def build_beside(artifact: Artifact, use: Callable[[Library], None]) -> threading.Thread | None:
    """Build a library in a process of its own. Programs that want the same one wait for the first.

    Args:
        artifact: The library. It is pickled.
        use: Receives the library. It may raise a CompileError.

    Returns:
        The thread that waits for the process and calls `use`; where there is no library, it logs why. None,
        and a warning, if no process can be started.
    """
    process = None
    try:
        turn = open(folder_in_use() / f"building-{hashed(artifact.key)}", "a")  # noqa: SIM115
        with contextlib.suppress(BlockingIOError):
            fcntl.flock(turn, fcntl.LOCK_EX | fcntl.LOCK_NB)
            process = _started(artifact, turn.fileno())
    except OSError as error:
        log.warning(UNUSED, f"no process can be started: {error}")
        return None
    thread = threading.Thread(
        target=_wait, args=[process, turn, artifact, use], name="hybridyn-build", daemon=True
    )
    thread.start()
    return thread


def _started(artifact: Artifact, turn: int) -> subprocess.Popen[bytes]:
    """Start the process, which holds the lock `turn`.

    Raises:
        OSError: It cannot be started.
    """
    with tempfile.TemporaryFile() as request:
        pickle.dump(artifact, request)  # here: the caller may change the robot's caches while the thread runs
        request.seek(0)
        return subprocess.Popen(
            [sys.executable, "-c", PROGRAM, *sys.path],
            stdin=request,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            env=os.environ | {VARIABLE: str(folder_in_use())},
            pass_fds=[turn],
        )


def _wait(
    process: subprocess.Popen[bytes] | None, turn: IO[str], artifact: Artifact, use: Callable[[Library], None]
) -> None:
    """Wait for the library and use it; the quick one stays in use where there is none."""
    said = "another program could not build the optimised one"
    with turn:
        if process is None:
            fcntl.flock(turn, fcntl.LOCK_EX)
        else:
            assert process.stdout is not None
            with process:
                for line in process.stdout:
                    said = line.decode(errors="replace").strip() or said
                    log.info("%s", said)
            if process.returncode == 0:
                said = "the package or the compiler changed while the optimised one was built"
    try:
        if (built := artifact.known()) is None:
            raise CompileError(said)
        use(Library(built))
    except (CompileError, OSError) as error:
        log.warning(UNUSED, error)


def build_asked() -> None:
    """Build the library that another process asks for."""
    os.setpgrp()  # its compiler ends with it, and no Ctrl-C of the program ends them
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # temporary files are removed
    artifact: Artifact = pickle.load(sys.stdin.buffer)
    threading.Thread(target=_end_after_program, args=[os.getppid()], daemon=True).start()
    os.nice(POLITE)
    logging.basicConfig(stream=sys.stdout, level=logging.INFO, format="%(message)s")
    try:
        artifact.built(jobs=1)
    except HybridynError as error:
        sys.exit(str(error))


def _end_after_program(program: int) -> None:
    """Wait for the end of the program and `LEFT` seconds, then end this process and its compiler."""
    while os.getppid() == program:
        time.sleep(1.0)
    time.sleep(LEFT)
    os.killpg(0, signal.SIGTERM)


def different_programs(first: Library, second: Library) -> list[str]:
    """Return the names of programs that give different bits in two libraries, at random inputs."""
    generator = np.random.default_rng(1)
    out = []
    for name, calls in first.programs.items():
        inputs = [generator.normal(size=(SAMPLES, size)) for _, size in calls.inputs]
        (one, guard), (other, other_guard) = (x.programs[name].batch(inputs, 1) for x in (first, second))
        pairs = zip((*one, guard), (*other, other_guard), strict=True)
        if not all(np.array_equal(x, y, equal_nan=True) for x, y in pairs):
            out.append(name)
    return out


class Current:
    """The library in use.

    Attributes:
        library: The library; it may be a quick build of one program.
        artifact: What leads to the library of all programs.
    """

    def __init__(self, library: Library, use: Callable[[Library], None], artifact: Artifact) -> None:
        """Use a library; if it is a quick build, have the optimised one built. `use` takes each."""
        self.library, self._use, self.artifact = library, use, artifact
        self._lock = threading.Lock()
        self._building: threading.Thread | None = None
        use(library)
        if library.built.quick:
            self._building = build_beside(artifact, self._replace)

    def program(self, name: str) -> Calls:
        """Return the calls of a program; if it is not there yet, a quick library of all is built."""
        if name not in self.library.programs:
            with self._lock:
                if name not in self.library.programs:
                    self._take(self.artifact.loaded(Library, quick=True))
        return self.library.programs[name]

    def whole(self) -> Library:
        """Return a library of all programs; build it if there is none yet."""
        self.program("ddm")
        return self.library

    def wait(self) -> None:
        """Wait until the optimised library is in use, or cannot be."""
        if self._building is not None:
            self._building.join()

    def _replace(self, library: Library) -> None:
        """Use the optimised library.

        Raises:
            CompileError: It gives other bits.
        """
        with self._lock:
            if differing := different_programs(self.library, library):
                raise CompileError(f"the optimised build gives other bits in {', '.join(differing)}")
            self._take(library)

    def _take(self, library: Library) -> None:
        self.library = library
        self._use(library)
