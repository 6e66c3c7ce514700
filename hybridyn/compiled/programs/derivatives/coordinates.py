"""Which coordinates derivatives can have."""

from __future__ import annotations

from collections.abc import Iterable

from ....description.names import counted
from ....errors import ModelError
from ....structure.module import Module
from ....structure.robot import HybridRobot
from ...equations.idle.motion import idle_motions


def check_coordinates(robot: HybridRobot, model: str, coordinates: str) -> None:
    """Refuse coordinates that are unknown, or that the derivatives of a model of a robot cannot have.

    Raises:
        ModelError: They are unknown; the base has a prescribed motion, and the model is direct; or they are
            "motors", and the base is not fixed, or a module has not as many motors as freedoms, but for idle
            motions, or one that its loops lock.
    """
    if coordinates not in ("joints", "motors"):
        raise ModelError(f"coordinates of derivatives are 'joints' or 'motors', not {coordinates!r}")
    if model == "ddm" and robot.base == "moving":
        raise ModelError(
            "derivatives of 'ddm' need a base that is fixed or floating; the motion of this one is "
            "prescribed. Differentiate 'idm', or load the robot with base='floating'"
        )
    if coordinates == "joints":
        return
    mend = "Use coordinates='joints'"
    if robot.base != "fixed":
        raise ModelError(f"derivatives over motors need a fixed base; this one is '{robot.base}'. {mend}")
    _check_independent(robot.modules, mend)


def check_closing(robot: HybridRobot, model: str, coordinates: str) -> None:
    """Refuse what has no derivatives of the motion of all joints over the motors'.

    Raises:
        ModelError: The coordinates are not "motors", the base has a prescribed motion, or a module with loops
            has not as many motors as freedoms, as in `check_coordinates`.
    """
    if coordinates != "motors":
        raise ModelError(f"derivatives of '{model}' need coordinates='motors', not {coordinates!r}")
    if robot.base == "moving":
        raise ModelError(
            f"derivatives of '{model}' need a base that is fixed or floating; the motion of this one is "
            "prescribed. Load the robot with base='floating'"
        )
    looped = [module for module in robot.modules if module.mechanism.spanning_closures.rows]
    _check_independent(looped, "Name its motors with motors=[...]")


def _check_independent(modules: Iterable[Module], mend: str) -> None:
    """Refuse modules of which the motors are not the independent coordinates."""
    for module in modules:
        motors = module.motors
        locked = [name for i, name in enumerate(motors) if i not in module.moving_motors]
        if locked:
            raise ModelError(
                f"module '{module.name}': its loops lock motor '{locked[0]}', which is no coordinate. {mend}",
                element=locked[0],
            )
        freedoms = module.mobility - len(idle_motions(module.mechanism, module.motor_columns))
        if len(motors) != freedoms:
            raise ModelError(
                f"module '{module.name}': {counted(len(motors), 'motor')} for "
                f"{counted(freedoms, 'freedom')} are not its independent coordinates. {mend}",
                element=module.name,
            )
