"""Build all models of one robot as programs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

from ...effects.choice import Choice
from ...structure.parameters.slots import Slot
from ...structure.robot import HybridRobot
from ..equations.request import Request, request
from ..program import Program
from .close import close_program, lift_program
from .direct import direct_program
from .inverse import inverse_program
from .kinematics import kinematics_program


def programs(
    robot: HybridRobot,
    effects: Choice = None,
    *,
    models: tuple[str, ...] = ("idm", "ddm", "kinematics", "lift"),
    regroup: bool = True,
    parameters: bool | Sequence[Slot] = False,
    dtype: str = "float64",
) -> dict[str, Program]:
    """Build a robot's models as programs.

    Args:
        effects: Effects to include, as for `hybridyn.idm`.
        models: Names of the models: "idm", "ddm", "kinematics"; "lift", a Newton step onto the assembled
            postures, left out if the robot has no such program; "close", the motion of all joints from the
            motors'; "idm_pushed" and "ddm_pushed", those of a floating robot under a wrench on its base.
        regroup: Whether base inertial parameters are used.
        parameters: Numbers of the description that are an input ("parameters"); True for the inertial
            parameters of the bodies, ten for each body of `robot.bodies` in the order and frame of
            `pinocchio.Inertia.toDynamicParameters`. "lift" is then left out, and for True "close", too.
        dtype: Type of the arithmetic, "float64" or "float32". The general path computes samples whose loops
            are open by more than its rounding.

    Raises:
        ModelError: An effect is not available in compiled models.
    """
    asked = request(robot, effects, regroup=regroup, parameters=parameters, dtype=dtype)
    write: dict[str, Callable[[Request], Program | None]] = {
        "idm": inverse_program,
        "ddm": direct_program,
        "idm_pushed": partial(inverse_program, pushed=True),
        "ddm_pushed": partial(direct_program, pushed=True),
        "kinematics": kinematics_program,
        "lift": lift_program,
        "close": close_program,
    }
    if asked.arguments is not None:
        known = ("idm", "ddm", "kinematics", "close" if parameters is not True else "idm")
        models = tuple(name for name in models if name in known)
    written = {name: write[name](asked) for name in models}
    return {name: program for name, program in written.items() if program is not None}
