"""What is asked for where C is generated: a robot, effects, parameters and a type of numbers, checked."""

from __future__ import annotations

from collections.abc import Sequence

from ..effects.choice import Choice, Effects, choose
from ..errors import ModelError
from ..structure.parameters.entries import Parameters
from ..structure.parameters.slots import Slot
from ..structure.robot import HybridRobot
from .code.scalars import REAL
from .equations.arguments.coefficients import check_coefficients, with_stated_springs


def asked_for(
    robot: HybridRobot, effects: Choice, parameters: Sequence[str | Slot], dtype: str, alone: str = ""
) -> tuple[HybridRobot, Effects, Parameters]:
    """Return the robot (with the springs of its effects if it has parameters), its effects and parameters.

    Args:
        alone: What the models are part of where nothing of hybridyn stands around them.

    Raises:
        ModelError: A parameter is unknown, `dtype` is invalid, or an effect is not available; or no joint
            moves, or efforts are limited, in models that are alone.
    """
    if dtype not in REAL:
        raise ModelError(f"dtype must be {' or '.join(map(repr, REAL))}, not {dtype!r}")
    if alone and not robot.nv:
        raise ModelError(f"robot '{robot.name}' has no joint that moves: there is nothing to compute")
    on = choose(robot, effects)
    if alone and on.limits is not None:
        why = f"the effect 'limits' is not part of {alone}: clip the efforts before the call"
        raise ModelError(why, element="limits")
    robot = with_stated_springs(robot, on) if parameters else robot
    chosen = Parameters(robot.description, parameters)
    check_coefficients(robot, on, chosen.slots)
    return robot, on, chosen
