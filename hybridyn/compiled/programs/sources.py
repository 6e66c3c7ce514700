"""What is asked for where C is generated, checked; programs of models, their C source, their libraries."""

from __future__ import annotations

import hashlib
import pickle
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, TypeVar

from ...effects.choice import Choice, Effects, choose, without_losses
from ...effects.others import is_other
from ...errors import ModelError
from ...structure.parameters.chosen import Parameters
from ...structure.parameters.slots import Slot
from ...structure.robot import HybridRobot
from ..code.scalars import REAL, Scalar
from ..equations.coefficients import check_coefficients, with_stated_effects
from ..library.artifact import Artifact
from ..library.cache import Built

if TYPE_CHECKING:
    from ..code.library_source import Source

Key = TypeVar("Key")
Value = TypeVar("Value")

#: Models of a library.
MODELS = ("idm", "ddm", "kinematics", "lift")


#: Number of programs of each kind that are kept for one robot: for choices of given joints, coordinates, ...
KEPT = 16


def kept(known: dict[Key, Value], key: Key, make: Callable[[], Value], most: int = KEPT) -> Value:
    """Return a value that is kept by its key, made if it is new; beyond `most` the one last used goes."""
    known[key] = found = known.pop(key) if key in known else make()
    if len(known) > most:
        del known[next(iter(known))]
    return found


def robot_key(robot: HybridRobot, effects: Effects | None) -> str:
    """Return a hash of everything that the models of a robot depend on; without effects, its kinematics.

    Where its file lies, and what its reader remarked, are no part of it. The code of other packages is: it
    may change while its numbers stay.
    """
    told = replace(robot.description, source=None, read_from=None, notes=())
    own, others = (effects, []) if effects is None else _told_apart(robot, effects)
    facts = (
        told, robot.base, robot.gravity, robot.motors, robot.home, robot.closure_tolerance,
        robot.rank_tolerance, sorted(robot.held), robot.payloads, own, others,
    )  # fmt: skip
    return hashlib.sha256(pickle.dumps(facts)).hexdigest()


def _told_apart(robot: HybridRobot, effects: Effects) -> tuple[Effects, list[bytes]]:
    """Return the effects of hybridyn, and what determines the laws of other packages in the models."""
    laws = [law for law in effects.joints if is_other(type(law.effect))]
    wrenches = [law for law in effects.links if is_other(type(law))]
    if not laws and not wrenches:
        return effects, []
    from .on_symbols import text_of  # it takes CasADi

    own = replace(
        effects,
        joints=tuple(law for law in effects.joints if not is_other(type(law.effect))),
        links=tuple(law for law in effects.links if not is_other(type(law))),
    )
    return own, text_of(robot, laws, wrenches)


def library_of(
    robot: HybridRobot,
    effects: Effects,
    scalar: Scalar,
    check: Callable[[Built], None] | None,
    parameters: Sequence[Slot] = (),
    models: tuple[str, ...] = MODELS,
) -> Artifact:
    """Return the library of a robot's models.

    Args:
        effects: Effects in the models.
        scalar: Scalar type and number of lanes.
        check: As in `Artifact`.
        parameters: Numbers of the description that are arguments of the models.
        models: Names of the models.
    """
    key = [robot_key(robot, effects), repr(scalar), *map(repr, parameters), *models]
    return Artifact(
        robot, " ".join(key), partial(source_of, robot, effects, scalar, parameters, models), check
    )


def source_of(
    robot: HybridRobot,
    effects: Effects,
    scalar: Scalar,
    parameters: Sequence[Slot] = (),
    models: tuple[str, ...] = MODELS,
) -> Source:
    """Generate the C source of a robot's models."""
    from ..code.library_source import library_source
    from .whole_robot import programs

    written = programs(robot, effects, models=models, dtype=scalar.name, parameters=parameters)
    return library_source(list(written.values()), scalar)


def asked_for(
    robot: HybridRobot, effects: Choice, parameters: Sequence[str | Slot], dtype: str, alone: str = ""
) -> tuple[HybridRobot, Effects, Parameters]:
    """Return the robot (which states its effects if it has parameters), its effects and parameters.

    Args:
        alone: What the models are part of where nothing of hybridyn stands around them.

    Raises:
        ModelError: A parameter is unknown, `dtype` is invalid, or an effect is not available; or no joint
            moves, or efforts are limited, in models that are alone; or the shares of motors in a load follow
            a parameter, or the begin of a stop does; or no number of the models depends on the parameters.
    """
    if dtype not in REAL:
        raise ModelError(f"dtype must be {' or '.join(map(repr, REAL))}, not {dtype!r}")
    if alone and not robot.nv:
        raise ModelError(f"robot '{robot.name}' has no joint that moves: there is nothing to compute")
    on = without_losses(choose(robot, effects), "compiled models do not take", compiled=True)
    if alone and on.limits is not None:
        why = f"the effect 'limits' is not part of {alone}: clip the efforts before the call"
        raise ModelError(why, element="limits")
    robot = with_stated_effects(robot, on, parameters) if parameters else robot
    chosen = Parameters(robot.description, parameters)
    check_coefficients(robot, on, chosen.slots)
    if chosen.arguments is not None:
        chosen.arguments.model(robot, on.ends)
    if chosen.size and not chosen.slots:
        raise ModelError(f"no number of the models depends on {', '.join(chosen.labels)}: leave them out")
    return robot, on, chosen
