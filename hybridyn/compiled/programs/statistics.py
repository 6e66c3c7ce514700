"""Count the operations of a robot's models before and after each reduction."""

from __future__ import annotations

from ...effects.choice import Choice
from ...structure.robot import HybridRobot
from ..code.operations import operations_table
from ..needs import needs_casadi
from ..program import Program

MODELS = ("idm", "ddm")


def statistics(robot: HybridRobot, effects: Choice = None) -> str:
    """Return a printable table of the operations of both models, by part and by variant.

    The first variant has inertial parameters as inputs and body axes that are aligned with no joint. Each
    further variant adds one reduction: axes aligned with the joints, so that zeros and ones vanish; constant
    inertial parameters; base inertial parameters.

    Args:
        robot: The robot.
        effects: Effects to include, as for `hybridyn.idm`.

    Raises:
        ModelError: An effect is not available in compiled models.
        CompileError: casadi is not installed.
    """
    needs_casadi()
    from .whole_robot import programs

    variants: dict[str, dict[str, Program]] = {
        name: programs(
            robot, effects, models=MODELS, regroup=regroup, align=align, parameters=parameters, counted=True
        )
        for name, regroup, align, parameters in (
            ("axes and inertial parameters of any kind", False, False, True),
            ("axes of the joints", False, True, True),
            ("inertial parameters folded in", False, True, False),
            ("base inertial parameters", True, True, False),
        )
    }
    titles = {"idm": "Inverse model, operations per sample", "ddm": "Direct model, operations per sample"}
    tables = [
        f"{title}\n\n" + operations_table({name: models[model] for name, models in variants.items()})
        for model, title in titles.items()
    ]
    return "\n\n".join(tables)
