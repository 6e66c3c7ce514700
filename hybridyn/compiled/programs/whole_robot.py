"""Every model of one robot as programs."""

from __future__ import annotations

from collections.abc import Callable

from ...effects.choice import Choice
from ...structure.robot import HybridRobot
from ..equations.request import Request, request
from ..program import Program
from .close import close_program
from .direct import direct_program
from .inverse import inverse_program
from .kinematics import kinematics_program
from .lift import lift_program


def programs(
    robot: HybridRobot,
    effects: Choice = None,
    *,
    models: tuple[str, ...] = ("idm", "ddm", "kinematics", "lift"),
    regroup: bool = True,
    align: bool = True,
    parameters: bool = False,
    dtype: str = "float64",
) -> dict[str, Program]:
    """Write a robot's models out.

    Args:
        robot: The robot.
        effects: As `hybridyn.idm` takes them.
        models: Which models: "idm", "ddm", "kinematics"; "lift", onto the assembled postures, where it can be
            written; "close", from motors' motion to that of all joints.
        regroup: Whether base inertial parameters are used.
        align: Whether bodies' axes are turned into their joints', so that zeros and ones leave no operations;
            else they are turned away from them.
        parameters: Whether the inertial parameters of the bodies are an input ("parameters"), ten for each
            body of `robot.bodies` in the order and frame of `pinocchio.Inertia.toDynamicParameters`.
        dtype: What they compute with, "float64" or "float32": samples whose loops are open by more than its
            rounding go to the general path.

    Raises:
        ModelError: An effect is not for written-out models.
    """
    asked = request(robot, effects, regroup=regroup, align=align, parameters=parameters, dtype=dtype)
    write: dict[str, Callable[[Request], Program | None]] = {
        "idm": inverse_program,
        "ddm": direct_program,
        "kinematics": kinematics_program,
        "lift": lift_program,
        "close": close_program,
    }
    written = {name: write[name](asked) for name in models}
    return {name: program for name, program in written.items() if program is not None}
