"""A program of second derivatives, in C or, until it is built, by CasADi."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ...effects.choice import Effects
from ...spatial import Array
from ...structure.parameters.chosen import Parameters
from ...structure.robot import HybridRobot
from ..comparing import States, compare_at_states, random_states
from ..failures import as_compile_error
from ..library.cache import Built
from ..library.calls import Library
from ..program import Program
from ..programs.built_beside import BuiltBeside
from ..rounding import changes_by_rounding, rounded

#: Largest difference of a new library from CasADi, of the largest entry: rounding, with its growth.
SAME_IN_C = 1e-8


class Prepared(BuiltBeside):
    """One program of a robot."""

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
        self.robot, self._effects, self._parameters = robot, effects, parameters
        self._called, self._written = name, write
        with as_compile_error(robot):
            self.find_library(parameters.slots)

    @property
    def _name(self) -> str:
        return self._called

    def _write(self) -> Program:
        return self._written()

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
            q, v, tau, a = random_states(self.robot, seed, idle=False)
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

        def rounding(given: States, _: object, wanted: Sequence[Array]) -> Array:
            """Compute what rounding explains: all of a derivative whose terms cancel at every state."""
            return changes_by_rounding(lambda random: known(*(rounded(x, random) for x in given)), wanted)

        compare_at_states(
            self.robot, f"'{self._name}'", run, known, SAME_IN_C, states=states, excused=rounding, told=False
        )
