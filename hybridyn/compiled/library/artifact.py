"""A library and what it is made from: found in the cache, or written, built, checked and kept."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, TypeVar

from ...description.cache_folder import VARIABLE, check_ownership
from ...errors import CompileError, HybridynError
from ..failures import as_compile_error, needs_casadi
from .cache import Built, folder_in_use, keep, kept, library_of_source, name_of_key

if TYPE_CHECKING:
    from ...structure.robot import HybridRobot
    from ..code.library_source import Source

log = logging.getLogger("hybridyn.compiled")
Used = TypeVar("Used")


@dataclass(frozen=True, eq=False)
class Artifact:
    """A library.

    Attributes:
        robot: The robot of its programs, which errors name; or None.
        key: Text that determines the source and is cheap to compute.
        write: Generates the source, where CasADi is installed.
        check: Compares a new library with the general path and raises an error if it is wrong; or None.
        libraries: Linker flags of further libraries; -lm is always linked.
    """

    robot: HybridRobot | None
    key: str
    write: Callable[[], Source]
    check: Callable[[Built], None] | None = None
    libraries: tuple[str, ...] = ()

    @cached_property
    def source(self) -> Source:
        """The source, which is generated once.

        Raises:
            CompileError: CasADi is not installed, or the source cannot be generated.
        """
        needs_casadi()
        with as_compile_error(self.robot):
            return self.write()

    def known(self) -> Built | None:
        """Return the library if it is in the cache; errors are those of `built`."""
        at = folder_in_use()
        check_ownership(at)
        return kept(at, name_of_key(self.key, self.libraries))

    def built(self, *, jobs: int | None = None) -> Built:
        """Return the library from the cache, or build it; one that `check` refuses is not kept.

        Args:
            jobs: Number of C files that are compiled at once; None for that of the cores.

        Raises:
            CompileError: There is no compiler, the compiler fails, the cache folder cannot be used, or other
                users can write in it; the source cannot be generated; or `check` fails.
        """
        if (found := self.known()) is not None:
            return found
        at, key = folder_in_use(), name_of_key(self.key, self.libraries)
        source, whose = self.source, self.robot.name if self.robot else ""
        try:
            found = library_of_source(at, source, self.libraries, jobs, whose)
            if self.check is not None:
                with as_compile_error(self.robot):
                    self.check(found)
            keep(at, key, found)
        except OSError as error:  # a full disk, a folder where a file should be
            raise CompileError(
                f"the cache folder '{at}' cannot be used: {error}; repair it, or name another in {VARIABLE}"
            ) from error
        return found

    def loaded(self, use: Callable[[Built], Used]) -> Used:
        """Return what loads the library; build it again if another process removed it after it was found.

        Errors are those of `built`.

        Args:
            use: Loads it: `Library`, or what holds one.
        """
        try:
            return use(self.built())
        except OSError:
            return use(self.built())

    def tried(self, use: Callable[[Built], Used], otherwise: str) -> Used | None:
        """Return what loads the library; None, and a warning that says what is done otherwise, without it."""
        try:
            return self.loaded(use)
        except (HybridynError, OSError) as error:
            log.warning("%s (%s)", otherwise, error)
            return None
