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
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import IO

import numpy as np

from ...description.cache_folder import VARIABLE, folder
from ...errors import CompileError, HybridynError
from .artifact import Artifact
from .cache import Built, folder_in_use
from .calls import Calls, Library

log = logging.getLogger("hybridyn.compiled")

#: Samples on which the bits are compared: full vectors, and one that is not full.
SAMPLES = 37
#: Longest time that a build goes on after the end of its program [s]; that of the LX4 takes seven.
LEFT = 30.0
#: How much rather the processor serves the program, which may be building other libraries.
POLITE = 5
UNUSED = "there is no optimised library, so what is in use stays: %s"
#: Program of the process, which gets the program's number, the time that it has after it, and Python's path.
PROGRAM = """
import sys
program, left, *sys.path[:] = sys.argv[1:]
from hybridyn.compiled.library.current import build_asked
build_asked(int(program), float(left))
"""


def build_beside(artifact: Artifact, use: Callable[[Library], None]) -> threading.Thread | None:
    """Build a library in a process of its own, one after the other in a cache folder.

    Args:
        artifact: The library. It is pickled.
        use: Receives the library.

    Returns:
        The thread that waits for the process and calls `use`; where there is no library, it logs why. None,
        and a warning, if no process can be started.
    """
    asked = pickle.dumps(artifact)  # here: the caller may change the robot's caches while the thread runs
    process = None
    try:
        turn = open(folder_in_use() / "turn", "a")  # noqa: SIM115
        with contextlib.suppress(BlockingIOError):
            fcntl.flock(turn, fcntl.LOCK_EX | fcntl.LOCK_NB)
            process = _started(asked, turn.fileno())  # here: the program may end before the thread runs
    except OSError as error:
        log.warning(UNUSED, f"no process can be started: {error}")
        return None
    thread = threading.Thread(
        target=_wait, args=[process, turn, asked, artifact, use], name="hybridyn-build", daemon=True
    )
    thread.start()
    return thread


def _started(asked: bytes, turn: int) -> subprocess.Popen[bytes]:
    """Start the process, which holds the lock `turn`.

    Raises:
        OSError: It cannot be started.
    """
    left = LEFT if folder_in_use() == folder() else 0.0  # nobody finds a library in a temporary folder
    with tempfile.TemporaryFile() as request:
        request.write(asked)
        request.seek(0)
        return subprocess.Popen(
            [sys.executable, "-c", PROGRAM, str(os.getpid()), str(left), *sys.path],
            stdin=request,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            env=os.environ | {VARIABLE: str(folder_in_use())},
            process_group=0,
            pass_fds=[turn],
        )


def _wait(
    process: subprocess.Popen[bytes] | None,
    turn: IO[str],
    asked: bytes,
    artifact: Artifact,
    use: Callable[[Library], None],
) -> None:
    """Wait for the library and use it; the quick one stays in use where there is none."""
    said = ""
    try:
        with turn:
            if process is None:
                fcntl.flock(turn, fcntl.LOCK_EX)
                if artifact.known() is None:  # nobody has built it meanwhile
                    process = _started(asked, turn.fileno())
            if process is not None:
                said = _said(process)
        if (built := artifact.known()) is None:
            raise CompileError(said)
        use(Library(built))
    except (CompileError, OSError) as error:
        log.warning(UNUSED, error)


def _said(process: subprocess.Popen[bytes]) -> str:
    """Wait for the process, log its progress, and return what to say if there is no library."""
    said = "the process that builds ended without a word"
    with process:
        for line in process.stdout or ():
            said = line.decode(errors="replace").strip() or said
            log.info("%s", said)
    return said if process.returncode else "the package or the compiler changed while it was built"


def build_asked(program: int, left: float) -> None:
    """Build the library that another process asks for.

    Args:
        program: Number of that process.
        left: Time that the build has after its end [s]; 0 in a temporary folder, which is then removed.
    """
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # temporary files are removed
    artifact: Artifact = pickle.load(sys.stdin.buffer)
    threading.Thread(target=_end_after_program, args=[program, left], daemon=True).start()
    os.nice(POLITE)
    logging.basicConfig(stream=sys.stdout, level=logging.INFO, format="%(message)s")
    try:
        artifact.built(jobs=1)
    except HybridynError as error:
        sys.exit(str(error))
    finally:
        if left == 0.0 and os.getppid() != program:
            shutil.rmtree(folder(), ignore_errors=True)


def _end_after_program(program: int, left: float) -> None:
    """Wait for the end of the program and some seconds, then end this process group: the compiler, too."""
    while os.getppid() == program:
        time.sleep(1.0)
    time.sleep(left)
    os.killpg(0, signal.SIGTERM)


def check_bits(check: Callable[[Built], None] | None, quick: Built, built: Built) -> None:
    """Check a library, and that it gives the bits of a quick one.

    Raises:
        CompileError: It does not, or as `check` raises.
    """
    if check is not None:
        check(built)
    if differing := different_programs(Library(quick), Library(built)):
        raise CompileError(f"the optimised build gives other bits in {', '.join(differing)}")


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
        self._lock = threading.RLock()
        self._building: threading.Thread | None = None
        use(library)
        if library.built.quick:
            check = partial(check_bits, artifact.check, library.built)
            self._building = build_beside(replace(artifact, check=check), self._take)

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

    def _take(self, library: Library) -> None:
        with self._lock:
            self.library = library
            self._use(library)
