"""Build the optimised library of a model while a program already runs on the quick one, and replace it.

One thread runs the compiler, one unit after the other, so that the program keeps its other cores. The
optimised library is used only if it gives the same bits. A program that ends first ends the compiler; the
next one begins again. A program that a signal ends leaves the compiler at its unit, a few seconds at most.
"""

from __future__ import annotations

import atexit
import contextlib
import logging
import os
import signal
import subprocess
import threading
import weakref
from collections.abc import Callable

import numpy as np

from ...errors import CompileError
from .building import finish, start
from .cache import Built
from .calls import Library

log = logging.getLogger("hybridyn.compiled")

#: Samples on which the bits are compared: full vectors, and one that is not full.
SAMPLES = 37
#: Time that a program waits at its end for the thread to remove its files [s].
PATIENCE = 5.0


class Replacement:
    """The build of an optimised library in a thread."""

    def __init__(
        self,
        quick: Library,
        find: Callable[..., Built],
        use: Callable[[Library], None],
    ) -> None:
        """Start the thread.

        Args:
            quick: The library in use.
            find: Returns the optimised one: `cache.cached` without its key and source.
            use: Method that receives the optimised library, in the thread, if its object is still in use.
        """
        self._quick, self._find, self._use = quick, find, weakref.WeakMethod(use)
        self._lock, self._stopped = threading.Lock(), False
        self._owner = os.getpid()
        self._process: subprocess.Popen[str] | None = None
        self._thread = threading.Thread(target=self._replace, name="hybridyn-build", daemon=True)
        atexit.register(self.stop)
        self._thread.start()

    def wait(self) -> None:
        """Wait until the optimised library is in use, or cannot be."""
        self._thread.join()

    def stop(self) -> None:
        """End the compiler and the thread; do nothing in a fork of the process that started them."""
        if os.getpid() != self._owner:
            return
        with self._lock:
            self._stopped = True
            if self._process is not None:
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(self._process.pid, signal.SIGKILL)
        self._thread.join(PATIENCE)

    def _replace(self) -> None:
        """Build, compare and use the library; the quick one stays in use where that fails."""
        try:
            library = Library(self._find(accept=self._compare, run=self._run))
            if (use := self._use()) is not None:
                use(library)
        except (CompileError, OSError) as error:
            if not self._stopped:
                log.warning("the quick build stays in use: %s", error)
        finally:
            atexit.unregister(self.stop)

    def _run(self, commands: list[list[str]]) -> None:
        """Run commands of the compiler one after the other, until `stop`."""
        for command in commands:
            with self._lock:
                if self._stopped:
                    raise CompileError("the program ends")
                self._process = start(command, apart=True)
            try:
                finish(self._process, command)
            finally:
                with self._lock:
                    self._process = None

    def _compare(self, built: Built) -> None:
        """Raise CompileError if a library does not give the bits of the quick one."""
        if differing := different_programs(self._quick, Library(built)):
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
