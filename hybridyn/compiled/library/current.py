"""The library that a model uses: a quick build of one program, then of all, then the optimised one.

A process of its own writes the source of the optimised library and runs the compiler, one unit after the
other, so that the program keeps its interpreter and its other cores. The library is used only if it gives the
same bits. The process ends with the program, whatever ends that; the next program begins again.
"""

from __future__ import annotations

import atexit
import contextlib
import logging
import os
import pickle
import signal
import subprocess
import sys
import threading
import weakref
from collections.abc import Callable
from typing import Any

import numpy as np

from ...description.cache_folder import VARIABLE
from ...errors import CompileError
from .building import run_one
from .cache import Built, folder_in_use
from .calls import Calls, Library

log = logging.getLogger("hybridyn.compiled")

#: Samples on which the bits are compared: full vectors, and one that is not full.
SAMPLES = 37
#: Time that a program waits at its end for the process to remove its files [s].
PATIENCE = 5.0
#: Program of the process: the function that is named by its module and name, on the request in its input.
PROGRAM = """
import importlib, sys
sys.path[:] = sys.argv[3:]
getattr(importlib.import_module(sys.argv[1]), sys.argv[2])()
"""


class Replacement:
    """The build of an optimised library in a process, and the thread that waits for it."""

    def __init__(
        self,
        build: Callable[[], None],
        request: Any,
        find: Callable[[], Built | None],
        use: Callable[[Library], None],
    ) -> None:
        """Start the process.

        Args:
            build: Function of a module that builds the library; it begins with `receive`.
            request: What it receives.
            find: Returns the library that was built.
            use: Method that receives the library, in the thread, if its object is still in use.
        """
        self._find, self._use = find, weakref.WeakMethod(use)
        self._owner, self._stopped = os.getpid(), False
        command = [sys.executable, "-c", PROGRAM, build.__module__, build.__name__, *sys.path]
        try:
            self._process = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                env=os.environ | {VARIABLE: str(folder_in_use())},
                process_group=0,
            )
        except OSError as error:
            raise CompileError(f"no process can be started for the optimised build: {error}") from error
        words = pickle.dumps(request)  # here: the caller may change the robot's caches while the thread runs
        self._thread = threading.Thread(
            target=self._replace, args=[words], name="hybridyn-build", daemon=True
        )
        atexit.register(self.stop)
        self._thread.start()

    def wait(self) -> None:
        """Wait until the optimised library is in use, or cannot be."""
        self._thread.join()

    def stop(self) -> None:
        """End the process and the thread; do nothing in a fork of the process that started them."""
        if os.getpid() != self._owner:
            return
        self._stopped = True
        for ending in (signal.SIGTERM, signal.SIGKILL):
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.killpg(self._process.pid, ending)
            self._thread.join(PATIENCE)
            if not self._thread.is_alive():
                return

    def _replace(self, request: bytes) -> None:
        """Wait for the library and use it; the quick one stays in use where there is none."""
        process = self._process
        assert process.stdin is not None
        assert process.stdout is not None
        with process.stdout, contextlib.suppress(BrokenPipeError), process.stdin:
            with contextlib.suppress(BrokenPipeError):  # it ended: its output says why
                process.stdin.write(request)
                process.stdin.flush()
            said = f"there is none; status {process.poll()}"
            for line in process.stdout:
                said = line.decode(errors="replace").strip() or said
                log.info("%s", said)
            process.wait()
        atexit.unregister(self.stop)
        if self._stopped:
            return
        try:
            built = self._find()
            if process.returncode or built is None:
                raise CompileError(said)
            library = Library(built)
        except (CompileError, OSError) as error:
            log.warning("the quick build stays in use: %s", error)
            return
        if (use := self._use()) is not None:
            use(library)


def receive() -> Any:
    """Read the request of the process that started this one; end this process group when that one ends."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # temporary files are removed
    request = pickle.load(sys.stdin.buffer)
    threading.Thread(target=_end_with_program, daemon=True).start()
    return request


def _end_with_program() -> None:
    """Wait for the end of the input, then end this process and its compiler."""
    os.read(sys.stdin.fileno(), 1)
    os.killpg(0, signal.SIGTERM)


def run_in_turn(commands: list[list[str]]) -> None:
    """Run commands of the compiler one after the other, and say how many; errors are those of `run_one`."""
    for done, command in enumerate(commands, 1):
        run_one(command)
        sys.stdout.write(f"the C compiler has done {done} of {len(commands)} files\n")
        sys.stdout.flush()


def check_bits(quick: Library, built: Built) -> None:
    """Check that a library gives the bits of a quick one.

    Raises:
        CompileError: It does not.
    """
    if differing := different_programs(quick, Library(built)):
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


#: Programs of every library, except that of a quick build of one of them.
ALWAYS = ("idm", "ddm")


class Current:
    """The library in use.

    Attributes:
        library: The library; it may be a quick build of one program.
    """

    def __init__(self, library: Library, use: Callable[[Library], None]) -> None:
        """Use a library; `use` takes it, and those that replace it."""
        self.library, self._use = library, use
        self._lock = threading.Lock()
        self._build_all: Callable[[], Library] | None = None
        self._replacement: Replacement | None = None
        use(library)

    def replace_later(
        self, build_all: Callable[[], Library], replacing: Callable[[Callable[[Library], None]], Replacement]
    ) -> None:
        """Use the optimised library when it is there.

        Args:
            build_all: Builds a quick library of all programs, for a call of one that the first has not.
            replacing: Starts the build of the optimised library, and has the method that takes it.
        """
        if not all(name in self.library.programs for name in ALWAYS):
            self._build_all = build_all
        try:
            self._replacement = replacing(self._take)
        except CompileError as error:
            log.warning("the quick build stays in use: %s", error)

    def whole(self) -> Library:
        """Return a library of all programs; build it if there is none yet."""
        if self._build_all is not None:
            with self._lock:
                if (build_all := self._build_all) is not None:
                    self.library = build_all()
                    self._use(self.library)
                    self._build_all = None
        return self.library

    def program(self, name: str) -> Calls:
        """Return the calls of a program, which is built if it is not there yet."""
        found = self.library.programs.get(name)
        return self.whole().programs[name] if found is None else found

    def wait(self) -> None:
        """Wait until the optimised library is in use, or cannot be."""
        if self._replacement is not None:
            self._replacement.wait()

    def _take(self, library: Library) -> None:
        with self._lock:
            self._build_all = None
            self.library = library
            self._use(library)
