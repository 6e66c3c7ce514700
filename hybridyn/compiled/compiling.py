"""`hybridyn.compile`: generate C for a robot's models, build it, and check it against the general path."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from ..effects.choice import Choice, Effects
from ..errors import CompileError, HybridynError, ModelError
from ..structure.parameters.entries import Parameters
from ..structure.parameters.slots import Slot
from ..structure.robot import HybridRobot
from ..threads import one_thread
from .code.scalars import Scalar
from .equations.coefficients import at_robot
from .failures import as_compile_error
from .library.building import best_lanes, find_compiler
from .library.cache import Built, known
from .library.calls import Library, loaded
from .library.current import Replacement, check_bits, receive, run_in_turn
from .model import CompiledRobot
from .programs.designs import designs_to_verify
from .programs.sources import MODELS, Artifact, asked_for, library_key, library_of
from .verifying import verify, warn_of_handed_over

#: Models that a quick build may begin with, the default first.
FIRST = ("idm", "ddm")


@one_thread()
def compile(
    robot: HybridRobot,
    effects: Choice = None,
    *,
    parameters: Sequence[str | Slot] = (),
    threads: int = 1,
    dtype: str = "float64",
    quick: bool | str = False,
) -> CompiledRobot:
    """Generate C for a robot's models, build it, and check it against the general path.

    Libraries are kept in the user's cache folder, so that each model is built once.

    Args:
        robot: The robot.
        effects: Effects to include, as for `hybridyn.idm`.
        parameters: Numbers of the robot that calls may change, such as "mass:LINK", "position:JOINT",
            "spring_stiffness:JOINT" or "payload_mass:LINK" (`structure.parameters.entries.entry_of` lists
            them), or slots; all others are constants of the code.
        threads: Number of threads that share a batch.
        dtype: "float64", or "float32", which computes a batch twice as fast with seven digits.
        quick: Whether to return after a quick build (-Og) of one model: of `idm` (True or "idm"), or of `ddm`
            ("ddm"). It gives the same bits in about half more time. The first call that needs another model
            builds all models in the same way. Meanwhile a separate process builds the optimised library, and
            the model uses it as soon as it is built. This process ends with the program; the next program
            starts it again.

    Returns:
        The compiled models. Call `idm` and `ddm` like the functions of the general path.

    Raises:
        CompileError: There is no C compiler; casadi is not installed; the built model differs from the
            general path or would hand every sample to it; or the models cannot be generated for another
            reason.
        ModelError: A parameter is unknown, `dtype` or `threads` is invalid, or an effect is not available in
            compiled models.
    """
    if quick not in (True, False, *FIRST):
        raise ModelError(f"quick must be True, False, 'idm' or 'ddm', not {quick!r}")
    if threads < 1:
        raise ModelError(f"threads must be at least 1, not {threads}")
    asked = _Asked.of(robot, effects, parameters, dtype)
    with as_compile_error(robot):
        first = quick if isinstance(quick, str) else FIRST[0]
        library = loaded(lambda: asked.quickly(first) if quick else asked.built())
        compiled = CompiledRobot(asked.robot, asked.effects, library, threads, asked.parameters)
    if compiled.quick:
        compiled.replace_later(
            lambda: loaded(lambda: asked.built(quick=True)),
            lambda use: Replacement(build_optimised, (asked, library.built), asked.known, use),
        )
    return compiled


def inverse_model(robot: HybridRobot, effects: Effects, slots: Sequence[Slot]) -> tuple[Artifact, Parameters]:
    """Return the library of the inverse model alone, and its arguments, numbers in slots.

    Raises:
        CompileError, ModelError: As in `compile`.
    """
    asked = _Asked.of(robot, effects, slots, "float64")
    return asked.artifact(("idm",)), asked.parameters


@dataclass(frozen=True)
class _Asked:
    """The library that is asked for."""

    robot: HybridRobot
    effects: Effects
    parameters: Parameters
    scalar: Scalar
    key: str

    @staticmethod
    def of(robot: HybridRobot, effects: Choice, parameters: Sequence[str | Slot], dtype: str) -> _Asked:
        """Return what is asked for; the key is that of this process, as equal robots have several pickles.

        Raises:
            CompileError, ModelError: As in `compile`.
        """
        robot, on, chosen = asked_for(robot, effects, parameters, dtype)
        find_compiler()
        scalar = Scalar(dtype, best_lanes(dtype))
        key = library_key(robot, on, scalar, chosen.slots)
        return _Asked(robot, on, chosen, scalar, key)

    def artifact(
        self, models: tuple[str, ...] = MODELS, check: Callable[[Built], None] | None = None
    ) -> Artifact:
        """Return the library of some models."""
        slots, check = self.parameters.slots, check or self.accept
        return library_of(self.robot, self.effects, self.scalar, slots, models, self.key, check)

    def built(
        self,
        models: tuple[str, ...] = MODELS,
        check: Callable[[Built], None] | None = None,
        **options: Any,
    ) -> Built:
        """Find or build the library; `options` are those of `cache.cached`.

        Raises:
            CompileError: As in `compile`.
        """
        return self.artifact(models, check).built(**options)

    def known(self, *, quick: bool = False) -> Built | None:
        """Return the library if it is in the cache."""
        return known(self.key, quick=quick)

    def quickly(self, model: str) -> Built:
        """Return the library if it is in the cache, else a quick build with one model.

        Raises:
            CompileError: As in `compile`.
        """
        if (found := self.known(quick=True)) is not None:
            return found
        try:
            return self.built((model,), quick=True)
        except CompileError:  # perhaps the other models serve
            return self.built(quick=True)

    def accept(self, built: Built) -> None:
        """Compare a new library with the general path at each design to verify."""
        library = Library(built)
        for design, like, required in designs_to_verify(self.robot, self.parameters):
            if self.parameters.size:
                verify(library, like, at_robot(self.effects, like), required=required, design=design)
            else:
                verify(library, like, self.effects)
        if not self.parameters.size:
            warn_of_handed_over(library, self.robot, self.effects)


def build_optimised() -> None:
    """Build the optimised library of a model, in a process of its own (`library.replacing`)."""
    asked, quick = receive()
    first = Library(quick)

    def accept(built: Built) -> None:
        """Compare with the general path, and with the quick library bit by bit."""
        asked.accept(built)
        check_bits(first, built)

    try:
        asked.built(check=accept, run=run_in_turn)
    except HybridynError as error:
        sys.exit(str(error))
