"""The programs of second derivatives of a robot's models."""

from __future__ import annotations

from collections.abc import Sequence

from ...effects.choice import Effects
from ...structure.parameters.slots import Slot
from ...structure.robot import HybridRobot
from ..equations.request import request
from ..failures import as_compile_error
from ..program import Program
from .paths import A_NEAR, DELTA, MOTION, V_NEAR, along_closing, along_joints, along_motors
from .products import product_program
from .rates import rate_program

#: Result of each model.
RESULT = {"idm": "tau", "ddm": "a", "close": MOTION}


def inputs_of(model: str, *, motors: bool) -> dict[str, str]:
    """Return the inputs of a model over which it is differentiated, with their names in programs."""
    third = "tau" if model == "ddm" else "a"
    names = (DELTA, V_NEAR, A_NEAR if third == "a" else third) if motors else (DELTA, "v", third)
    return dict(zip(("q", "v", third), names, strict=True))


def second_program(
    robot: HybridRobot,
    effects: Effects,
    model: str,
    what: str,
    *,
    motors: bool,
    slots: Sequence[Slot] = (),
) -> Program:
    """Build a program of second derivatives.

    Args:
        robot: The robot.
        effects: Its effects.
        model: "idm", "ddm" or, over motors, "close".
        what: "product" or "path".
        motors: Whether the motors are the coordinates.
        slots: Numbers of the description that are an input, "parameters".

    Raises:
        ModelError: An effect is not available in compiled models.
        CompileError: The program cannot be written.
    """
    over, name = [*inputs_of(model, motors=motors).values()], name_of(model, what, motors=motors)
    with as_compile_error(robot):
        asked = request(robot, effects, parameters=slots, contacts=True)
        closing = model == "close"
        program = (
            along_closing(asked) if closing else (along_motors if motors else along_joints)(asked, model)
        )
        if what == "product":
            return product_program(program, name, RESULT[model], over, [DELTA])
        return rate_program(program, name, over, [DELTA])


def name_of(model: str, what: str, *, motors: bool) -> str:
    """Return the name of a program."""
    return f"{model}_{'motor_' * motors}{what}"
