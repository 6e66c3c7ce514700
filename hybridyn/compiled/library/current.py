"""The library that a model uses: a quick build of one program, then of all, then the optimised one."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable

from ...errors import CompileError
from .calls import Calls, Library
from .replacing import Replacement

log = logging.getLogger("hybridyn.compiled")

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
