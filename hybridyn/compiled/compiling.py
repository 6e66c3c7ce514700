"""`hybridyn.compile`: generate C for a robot's models, build it, and check it against the general path."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from ..effects.choice import Choice, Effects
from ..errors import HybridynError, ModelError
from ..structure.parameters.chosen import Parameters
from ..structure.parameters.slots import Slot
from ..structure.robot import HybridRobot
from ..threads import one_thread
from .code.scalars import Scalar
from .failures import as_compile_error
from .interpreted import InterpretedModels, accept, at_once
from .library.artifact import Artifact
from .library.building import best_lanes
from .library.cache import Built
from .library.calls import Library
from .model import CompiledRobot
from .programs.control import closing_of_motors, same_without_limits, torque_programs
from .programs.model_calls import ModelCalls
from .programs.sources import MODELS, asked_for, library_of


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

    CasADi runs the models of a new robot: at once, in some hundred microseconds a sample, and in other
    roundings than C. Meanwhile a separate process builds the library, and the model uses it as soon as it is
    built. One such process builds at a time. It goes on for at most half a minute after the end of the
    program, and the next program finds what it built. Without a C compiler, CasADi runs the models for good.

    Args:
        robot: The robot.
        effects: Effects to include, as for `hybridyn.idm`.
        parameters: Numbers of the robot that calls may change, such as "mass:LINK", "position:JOINT",
            "spring_stiffness:JOINT" or "payload_mass:LINK" (`structure.parameters.entries.entry_of` lists
            them), or slots; all others are constants of the code.
        threads: Number of threads that share a batch.
        dtype: "float64", or "float32", which computes a batch up to 1.4 times as fast with seven digits.
        wait: Whether to return with the library, for measurements of time, and for results that are the same,
            bit for bit, whenever they are computed.

    Returns:
        The compiled models. Call `idm` and `ddm` like the functions of the general path.

    Raises:
        CompileError: CasADi is not installed; there is no C compiler, and `wait` is set; the model differs
            from the general path or would hand every sample to it; or the models cannot be generated for
            another reason.
        ModelError: A parameter is unknown, `dtype` or `threads` is invalid, or an effect is not available in
            compiled models.

    Example:
        >>> robot = hybridyn.load("five_bar")
        >>> fast = hybridyn.compile(robot, parameters=["mass:m1_tool"])
        >>> q, v, a = hybridyn.assemble(robot, motors=([0.1, 0.2], [1.0, 0.0], [0.0, 0.0]))
        >>> fast.idm(q, v, a, parameters=[2.0]).round(3)
        array([ 4.355, -2.921])
    """
    if threads < 1:
        raise ModelError(f"threads must be at least 1, not {threads}")
    robot, on, chosen = asked_for(robot, effects, parameters, dtype)
    with as_compile_error(robot):
        whole = checked_library(robot, on, chosen, dtype)
        models = whole.loaded(Library) if wait else at_once(whole, robot, on, chosen, dtype)
        return CompiledRobot(ModelCalls(robot, on, chosen, threads, models, whole))


def interpreted_model(robot: HybridRobot, effects: Choice, name: str) -> CompiledRobot:
    """Return models that CasADi runs, and for which nothing is built; a first one is written.

    Raises:
        CompileError, ModelError: As in `compile`.
    """
    robot, on, chosen = asked_for(robot, effects, (), "float64")
    whole = checked_library(robot, on, chosen, "float64")
    models = InterpretedModels(robot, on, chosen, "float64", first=name, told=False)
    return CompiledRobot(ModelCalls(robot, on, chosen, 1, models, whole, builds=False))


def torque_models(compiled: CompiledRobot, on: Effects) -> dict[str, int] | None:
    """Return the addresses of the functions of computed torque, see `Law.tracking`.

    Args:
        compiled: Models of the robot.
        on: Effects of the torque; models are compiled for them where those of `compiled` differ.

    Returns:
        The addresses; None for idle joints besides redundant motors, a moving base, or losses that grow with
        load: the direct model, which is then inverted, is not linear in efforts with these.

    Raises:
        CompileError, ModelError: As in `compile`.
    """
    robot = compiled.robot
    closing, models = closing_of_motors(robot), compiled
    redundant = any(len(module.motors) > module.mobility for module in robot.modules)
    if closing is None and (redundant or robot.base == "moving" or on.gears or on.loaded):
        return None
    if not same_without_limits(robot, compiled.effects, on):
        models = compile(robot, on, wait=True)
    return torque_programs(models.library, closing)


def is_built(robot: HybridRobot, effects: Effects) -> bool:
    """Return whether `compile` finds the models in the cache."""
    try:
        robot, on, chosen = asked_for(robot, effects, (), "float64")
        return checked_library(robot, on, chosen, "float64").known() is not None
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
    """Return the library of some models; a new one is compared with the general path."""
    scalar, check = Scalar(dtype, best_lanes(dtype)), partial(_accept, robot, effects, chosen)
    return library_of(robot, effects, scalar, check, chosen.slots, models)


def _accept(robot: HybridRobot, effects: Effects, parameters: Parameters, built: Built) -> None:
    """Compare a new library with the general path."""
    accept(Library(built), robot, effects, parameters)
