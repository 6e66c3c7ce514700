"""A program of second derivatives, in C or, until it is built, by CasADi."""

from __future__ import annotations

import logging
from collections.abc import Callable
from functools import cached_property, partial
from threading import Thread
from typing import Any, ClassVar

import numpy as np

from ...effects.choice import Effects
from ...errors import CompileError
from ...spatial import Array
from ...structure.parameters.entries import Parameters
from ...structure.robot import HybridRobot
from ..code.library_source import Source, library_source
from ..code.scalars import Scalar
from ..comparing import compare_at_states, random_states
from ..failures import as_compile_error
from ..library.artifact import Artifact
from ..library.building import best_lanes, find_compiler
from ..library.cache import Built
from ..library.calls import Library
from ..library.current import build_beside
from ..program import Program
from ..programs.derivatives.evaluation import seconds_of
from ..programs.sources import robot_key
from ..programs.whole_robot import Interpreted

log = logging.getLogger("hybridyn.compiled")

#: Largest difference of a new library from CasADi, of the largest entry: rounding, with its growth.
SAME_IN_C = 1e-8


class Prepared:
    """One program of a robot.

    Attributes:
        patience: Time of the C compiler from which another process builds, and CasADi computes meanwhile [s].
        library: The library, once it is there.
    """

    patience: ClassVar[float] = 30.0

    def __init__(
        self,
        robot: HybridRobot,
        effects: Effects,
        name: str,
        write: Callable[[], Program],
        parameters: Parameters,
    ) -> None:
        """Load the program's library from the cache, or write the program and build it.

        Args:
            robot: The robot.
            effects: Its effects.
            name: Name of the program.
            write: Writes the program.
            parameters: Numbers that are its arguments.

        Raises:
            CompileError: The program cannot be written or built.
        """
        self._robot, self._name, self._write, self._parameters = robot, name, write, parameters
        self._building: Thread | None = None
        self.library: Library | None = None
        with as_compile_error(robot):
            try:
                find_compiler()
            except CompileError:
                return
            scalar = Scalar("float64", best_lanes())
            key = " ".join([name, robot_key(robot, effects), repr(scalar), *map(repr, parameters.slots)])
            artifact = Artifact(robot, key, partial(self._source, scalar), self._check)
            if artifact.known() is not None or (seconds := seconds_of(artifact.source)) <= self.patience:
                self._use(artifact.loaded(Library))
                return
            log.warning(
                "robot '%s': the C compiler takes about %.0f s for '%s'; CasADi computes it meanwhile",
                robot.description.name, seconds, name,
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
        with as_compile_error(self._robot):
            return Interpreted([self.program])

    def _source(self, scalar: Scalar) -> Source:
        return library_source([self.program], scalar)

    def _use(self, library: Library) -> None:
        self.library = library

    def wait_until_compiled(self) -> None:
        """Wait until another process has built the library, if there is one."""
        if self._building is not None:
            self._building.join()

    def run(self, *given: Array, threads: int = 1) -> tuple[dict[str, Array], Array]:
        """Run samples; return outputs by name, shape (T, n), and guards, shape (T,)."""
        engine = self.library or self._interpreted
        outputs = engine.programs[self._name].outputs
        found, guard = engine.programs[self._name].batch(given, threads)
        return {name: x for (name, _), x in zip(outputs, found, strict=True)}, guard

    def _check(self, built: Built) -> None:
        """Compare a new library with CasADi at random states, along random directions.

        Raises:
            CompileError: They differ.
        """
        library, sizes = Library(built), dict(self.program.inputs)

        def states(seed: int) -> list[Array]:
            """Draw the inputs."""
            q, v, tau, a = random_states(self._robot, seed, idle=False)
            slots = self._parameters.slot_values(np.tile(self._parameters.nominal, (len(q), 1)))
            known = {"near": q, "v": v, "v_near": v, "a": a, "a_near": a, "tau": tau, "parameters": slots}
            random = np.random.default_rng(seed)
            return [known.get(name, random.normal(size=(len(q), n))) for name, n in sizes.items()]

        def run(*given: Array) -> tuple[list[Array], Array]:
            """Compute the outputs in C."""
            found, guard = library.batch(self._name, *given)
            return list(found), guard

        def known(*given: Array) -> list[Array]:
            """Compute them by CasADi."""
            return list(self._interpreted.batch(self._name, *given)[0])

        compare_at_states(self._robot, f"'{self._name}'", run, known, SAME_IN_C, states=states, told=False)
