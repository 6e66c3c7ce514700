"""`hybridyn.compile`: generate C for a robot's models, build it, and check it against the general path."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from functools import partial

from ..effects.choice import Choice, Effects
from ..errors import CompileError, HybridynError, ModelError
from ..structure.parameters.entries import Parameters
from ..structure.parameters.slots import Slot
from ..structure.robot import HybridRobot
from ..threads import one_thread
from .code.scalars import Scalar
from .equations.coefficients import at_robot
from .failures import as_compile_error
from .library.artifact import Artifact
from .library.building import best_lanes, find_compiler
from .library.cache import Built
from .library.calls import Library
from .model import CompiledRobot
from .programs.designs import designs_to_verify
from .programs.sources import MODELS, asked_for, library_of
from .verifying import verify


@one_thread()
def compile(
    robot: HybridRobot,
    effects: Choice = None,
    *,
    parameters: Sequence[str | Slot] = (),
    threads: int = 1,
    dtype: str = "float64",
    wait: bool = False,
) -> CompiledRobot:
    """Generate C for a robot's models, build it, and check it against the general path.

    Libraries are kept in the user's cache folder, so that each model is built once.

    A new robot first gets a quick build (-Og) of `idm` alone; the first call that needs another model builds
    all of them so. It gives the same bits in about half more time. Meanwhile a separate process builds the
    optimised library, and the model uses it as soon as it is built. One such process
    builds at a time. It goes on for at most half a minute after the end of the program, and the next program
    finds what it built.

    Args:
        robot: The robot.
        effects: Effects to include, as for `hybridyn.idm`.
        parameters: Numbers of the robot that calls may change, such as "mass:LINK", "position:JOINT",
            "spring_stiffness:JOINT" or "payload_mass:LINK" (`structure.parameters.entries.entry_of` lists
            them), or slots; all others are constants of the code.
        threads: Number of threads that share a batch.
        dtype: "float64", or "float32", which computes a batch up to 1.4 times as fast with seven digits.
        wait: Whether to return with the optimised library, for measurements of time.

    Returns:
        The compiled models. Call `idm` and `ddm` like the functions of the general path.

    Raises:
        CompileError: There is no C compiler; casadi is not installed; the built model differs from the
            general path or would hand every sample to it; or the models cannot be generated for another
            reason.
        ModelError: A parameter is unknown, `dtype` or `threads` is invalid, or an effect is not available in
            compiled models.
    """
    if threads < 1:
        raise ModelError(f"threads must be at least 1, not {threads}")
    robot, on, chosen = asked_for(robot, effects, parameters, dtype)
    with as_compile_error(robot):
        whole = checked_library(robot, on, chosen, dtype)
        first = checked_library(robot, on, chosen, dtype, ("idm",))
        library = whole.loaded(Library) if wait else _quickly(whole, first)
        return CompiledRobot(robot, on, library, threads, chosen, whole)


def _quickly(whole: Artifact, first: Artifact) -> Library:
    """Return the library of all models if it is in the cache, else a quick build of the first."""
    if whole.known(quick=True) is None:
        with contextlib.suppress(CompileError):  # perhaps the other models serve
            return first.loaded(Library, quick=True)
    return whole.loaded(Library, quick=True)


def is_built(robot: HybridRobot, effects: Effects) -> bool:
    """Return whether `compile` finds the models in the cache."""
    try:
        robot, on, chosen = asked_for(robot, effects, (), "float64")
        return checked_library(robot, on, chosen, "float64").known(quick=True) is not None
    except (HybridynError, OSError):
        return False


def inverse_model(robot: HybridRobot, effects: Effects, slots: Sequence[Slot]) -> tuple[Artifact, Parameters]:
    """Return the library of the inverse model alone, and its arguments, numbers in slots.

    Raises:
        CompileError, ModelError: As in `compile`.
    """
    robot, on, chosen = asked_for(robot, effects, slots, "float64")
    return checked_library(robot, on, chosen, "float64", ("idm",)), chosen


def checked_library(
    robot: HybridRobot, effects: Effects, chosen: Parameters, dtype: str, models: tuple[str, ...] = MODELS
) -> Artifact:
    """Return the library of some models.

    Raises:
        CompileError: There is no C compiler.
    """
    find_compiler()
    scalar, check = Scalar(dtype, best_lanes(dtype)), partial(accept, robot, effects, chosen)
    return library_of(robot, effects, scalar, check, chosen.slots, models)


def accept(robot: HybridRobot, effects: Effects, parameters: Parameters, built: Built) -> None:
    """Compare a new library with the general path at each design to verify.

    Raises:
        CompileError: As in `compile`.
    """
    library = Library(built)
    for design, like, required in designs_to_verify(robot, parameters):
        on = at_robot(effects, like) if parameters.size else effects
        verify(library, like, on, required=required, design=design if parameters.size else None)
