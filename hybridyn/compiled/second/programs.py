"""The programs of second derivatives of a robot's models."""

from __future__ import annotations

from collections.abc import Sequence

from ...effects.choice import Effects
from ...structure.parameters.slots import Slot
from ...structure.robot import HybridRobot
from ..equations.request import request
from ..failures import as_compile_error
from ..program import Program
from .models import MODELS
from .paths import DELTA
from .products import product_program
from .rates import rate_program


def second_program(
    robot: HybridRobot,
    effects: Effects,
    model: str,
    what: str,
    *,
    coordinates: str,
    slots: Sequence[Slot] = (),
) -> Program:
    """Build a program of second derivatives.

    Args:
        robot: The robot.
        effects: Its effects.
        model: A name of `MODELS`.
        what: "product" or "path".
        coordinates: "joints" or "motors".
        slots: Numbers of the description that are an input, "parameters".

    Raises:
        ModelError: An effect is not available in compiled models.
        CompileError: The program cannot be written.
    """
    asks, name = MODELS[model], name_of(model, what, coordinates)
    over = [*asks.inputs(coordinates).values()]
    with as_compile_error(robot):
        program = asks.write[coordinates](request(robot, effects, parameters=slots, contacts=True))
        if what == "product":
            return product_program(program, name, asks.result, over, [DELTA])
        return rate_program(program, name, over, [DELTA])


def name_of(model: str, what: str, coordinates: str) -> str:
    """Return the name of a program."""
    return f"{model}_{'motor_' * (coordinates == 'motors')}{what}"
