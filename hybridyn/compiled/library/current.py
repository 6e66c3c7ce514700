"""What computes the models in use: CasADi, then the library, as soon as it is built.

A process of its own writes the source of the library and runs the compiler, one unit after the other, so that
the program keeps its interpreter and its other cores. After the end of the program the process goes on, for
at most `LEFT` seconds, and the next program finds what it built.
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
from collections.abc import Callable, Mapping
from typing import IO, Any, Protocol

import numpy as np

from ...description.cache_folder import VARIABLE, folder
from ...errors import CompileError, HybridynError
from .artifact import Artifact
from .building import has_compiler
from .cache import Built, folder_in_use
from .calls import Library
from .steps import Steps

log = logging.getLogger("hybridyn.compiled")

#: Longest time that a build goes on after the end of its program [s]; that of the LX4 takes seven.
LEFT = 30.0
#: How much rather the processor serves the program, which may be building other libraries.
POLITE = 5
UNUSED = "there is no library, so CasADi computes: %s"
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
    """Wait for the library and use it."""
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


class Models(Protocol):
    """Models of a robot: a `Library`, or those that CasADi runs."""

    @property
    def built(self) -> Built | None:
        """The library's file, or None."""
        ...

    @property
    def dtype(self) -> np.dtype[Any]:
        """Type of input and output arrays."""
        ...

    @property
    def steps(self) -> Steps | None:
        """Time steps in C, or None."""
        ...

    @property
    def programs(self) -> Mapping[str, Any]:
        """The programs by name; of those that CasADi runs, the ones that have been called."""
        ...

    def program(self, name: str) -> Any:
        """Return the calls of a program, or None if the robot has no such program."""
        ...


class Current:
    """The models in use.

    Attributes:
        models: The models.
        artifact: What leads to the library of all programs.
    """

    def __init__(
        self, models: Models, use: Callable[[Models], None], artifact: Artifact, *, builds: bool = True
    ) -> None:
        """Use models; if CasADi runs them, have the library built, if it `builds`. `use` takes each."""
        self.models, self._use, self.artifact = models, use, artifact
        self._building: threading.Thread | None = None
        use(models)
        if builds and models.built is None and has_compiler():
            self._building = build_beside(artifact, self.take)

    def program(self, name: str) -> Any:
        """Return the calls of a program, or None if the robot has no such program."""
        return self.models.program(name)

    def library(self) -> Library:
        """Return the library; wait until it is built.

        Raises:
            CompileError: It cannot be built.
        """
        self.wait()
        if not isinstance(self.models, Library):
            self.take(self.artifact.loaded(Library))
        assert isinstance(self.models, Library)
        return self.models

    def wait(self) -> None:
        """Wait until the library is in use, or cannot be."""
        if self._building is not None:
            self._building.join()

    def take(self, models: Models) -> None:
        """Use other models from now on."""
        self.models = models
        self._use(models)
