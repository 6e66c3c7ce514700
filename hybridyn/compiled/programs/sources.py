"""Generate the programs of a robot's models, their C source, and the built library."""

from __future__ import annotations

import functools
import hashlib
import pickle
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from ...effects.choice import Effects
from ...structure.parameters.slots import Slot
from ...structure.robot import HybridRobot
from ..code.scalars import Scalar
from ..failures import as_compile_error
from ..library.cache import Built, cached

if TYPE_CHECKING:
    from ..code.library_source import Source
    from ..program import Program

#: Models of a library.
MODELS = ("idm", "ddm", "kinematics", "lift")


def robot_key(robot: HybridRobot, effects: Effects | None) -> str:
    """Return a hash of everything that the models of a robot depend on; without effects, its kinematics."""
    facts = (
        robot.description, robot.base, robot.gravity, robot.motors, robot.home, robot.closure_tolerance,
        robot.rank_tolerance, sorted(robot.held), robot.payloads, effects,
    )  # fmt: skip
    return hashlib.sha256(pickle.dumps(facts)).hexdigest()


def library_of(
    robot: HybridRobot,
    effects: Effects,
    scalar: Scalar,
    parameters: Sequence[Slot] = (),
    models: tuple[str, ...] = MODELS,
    key: str = "",
) -> Callable[..., Built]:
    """Return `cache.cached` for a robot's models, without its key and source; the source is generated once.

    Args:
        effects: Effects in the models.
        scalar: Scalar type and number of lanes.
        parameters: Numbers of the description that are arguments of the models.
        models: Names of the models.
        key: Key of all models in the cache; empty to compute it.
    """
    key = key or library_key(robot, effects, scalar, parameters)
    source = functools.cache(lambda: source_of(robot, effects, scalar, parameters, models))
    return functools.partial(cached, key if models == MODELS else " ".join([key, *models]), source)


def library_key(robot: HybridRobot, effects: Effects, scalar: Scalar, parameters: Sequence[Slot] = ()) -> str:
    """Return the key of a robot's models in the cache; the arguments are those of `library_of`."""
    return robot_key(robot, effects) + repr(scalar) + (repr(parameters) if parameters else "")


def source_of(
    robot: HybridRobot,
    effects: Effects,
    scalar: Scalar,
    parameters: Sequence[Slot] = (),
    models: tuple[str, ...] = MODELS,
) -> Source:
    """Generate the C source of a robot's models.

    Raises:
        CompileError: casadi is not installed.
    """
    from ..needs import needs_casadi

    needs_casadi()
    from ..code.library_source import library_source

    written = write_programs(robot, effects, scalar.name, parameters, models)
    return library_source(list(written.values()), scalar)


def write_programs(
    robot: HybridRobot,
    effects: Effects,
    dtype: str = "float64",
    parameters: Sequence[Slot] = (),
    models: tuple[str, ...] = MODELS,
) -> dict[str, Program]:
    """Generate the programs of a robot's models.

    Raises:
        CompileError: casadi is not installed, or the models cannot be generated.
    """
    from ..needs import needs_casadi

    needs_casadi()
    from .whole_robot import programs

    with as_compile_error(robot):
        written = programs(robot, effects, models=models, dtype=dtype, parameters=parameters)
    return {name: replace(program, name=name) for name, program in written.items()}
