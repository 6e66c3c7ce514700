"""What the reductions save: operations of a robot's models before and after each."""

from __future__ import annotations

from ..effects.choice import Choice
from ..robot import HybridRobot
from .needs import needs_casadi
from .operations import operations_table
from .program import Program

MODELS = ("idm", "ddm")


def statistics(robot: HybridRobot, effects: Choice = None) -> str:
    """Give the operations of both models, part by part and variant by variant, as a table for people.

    First with inertial parameters that may be anything, then with their numbers folded in, then regrouped.
    Geometry is folded in everywhere: what of it is zero or one leaves no operation to count.

    Args:
        robot: The robot.
        effects: As `hybridyn.idm` takes them.

    Raises:
        ModelError: An effect is not for written-out models.
        CompileError: casadi is not installed.
    """
    needs_casadi()
    from .programs import programs

    variants: dict[str, dict[str, Program]] = {
        "inertial parameters as inputs": programs(
            robot, effects, models=MODELS, regroup=False, parameters=True
        ),
        "inertial parameters as described": programs(robot, effects, models=MODELS, regroup=False),
        "base inertial parameters": programs(robot, effects, models=MODELS),
    }
    titles = {"idm": "Inverse model, operations per sample", "ddm": "Direct model, operations per sample"}
    tables = [
        f"{title}\n\n" + operations_table({name: made[model] for name, made in variants.items()})
        for model, title in titles.items()
    ]
    return "\n\n".join(tables)
