"""A program of a robot that is in C or, until it is built, run by CasADi."""

from __future__ import annotations

import logging
import os
from collections.abc import Sequence
from functools import cached_property, partial
from threading import Thread
from typing import Any, ClassVar

from ...effects.choice import Effects
from ...errors import CompileError
from ...structure.parameters.slots import Slot
from ...structure.robot import HybridRobot
from ..code.library_source import Source, library_source
from ..code.scalars import Scalar
from ..failures import as_compile_error
from ..library.artifact import Artifact
from ..library.building import best_lanes, find_compiler
from ..library.cache import Built
from ..library.calls import Library
from ..library.current import build_beside
from ..program import Program
from .sources import robot_key
from .whole_robot import Interpreted

log = logging.getLogger("hybridyn.compiled")

#: Statements for which the C compiler takes a second, about.
STATEMENTS_A_SECOND = 1000


class BuiltBeside:
    """One program of one robot; its heirs set what they know of it, and then look for its library.

    Attributes:
        robot: The robot.
        library: The library, once it is there.
        patience: Time of the C compiler from which another process builds, and CasADi computes meanwhile [s].
        meanwhile: What the warning says of this time.
    """

    patience: ClassVar[float] = 30.0
    meanwhile: ClassVar[str] = "CasADi computes it meanwhile"
    robot: HybridRobot
    library: Library | None = None
    _effects: Effects
    _building: Thread | None = None

    @property
    def _name(self) -> str:
        """Name of the program."""
        raise NotImplementedError

    def _write(self) -> Program:
        """Write the program."""
        raise NotImplementedError

    def _check(self, built: Built) -> None:
        """Check a new library."""
        raise NotImplementedError

    def find_library(self, slots: Sequence[Slot] = ()) -> None:
        """Use the library from the cache, or build it; not without a compiler, or while it takes long."""
        try:
            find_compiler()
        except CompileError:
            return
        scalar = Scalar("float64", best_lanes())
        key = " ".join([self._name, robot_key(self.robot, self._effects), repr(scalar), *map(repr, slots)])
        artifact = Artifact(self.robot, key, partial(self._source, scalar), self._check)
        if artifact.known() is not None or (seconds := _seconds_of(artifact.source)) <= self.patience:
            self._use(artifact.loaded(Library))
            return
        log.warning(
            "robot '%s': the C compiler takes about %.0f s for '%s'; %s",
            self.robot.description.name, seconds, self._name, self.meanwhile,
        )  # fmt: skip
        self._building = build_beside(artifact, self._use)

    def __getstate__(self) -> dict[str, Any]:
        """Leave out what another process that builds the library does not need."""
        return {name: x for name, x in vars(self).items() if name not in ("program", "_interpreted")}

    @cached_property
    def program(self) -> Program:
        """The program."""
        return self._write()

    @cached_property
    def _interpreted(self) -> Interpreted:
        """The program, run by CasADi."""
        with as_compile_error(self.robot):
            return Interpreted([self.program])

    def _source(self, scalar: Scalar) -> Source:
        """Generate the C source."""
        return library_source([self.program], scalar)

    def _use(self, library: Library) -> None:
        """Use a library from now on."""
        self.library = library

    def wait_until_compiled(self) -> None:
        """Wait until another process has built the library, if there is one."""
        if self._building is not None:
            self._building.join()


def _seconds_of(source: Source) -> float:
    """Return about how long the C compiler takes on all cores [s]: the longest file, or its share of all."""
    statements = [unit.count("\n") for unit in source.units.values()]
    return max(max(statements), sum(statements) / (os.cpu_count() or 1)) / STATEMENTS_A_SECOND
