"""Which coordinates derivatives can have."""

from __future__ import annotations

from ....description.names import counted
from ....errors import ModelError
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
    for module in robot.modules:
        motors = [robot.motors[i] for i in module.motor_index]
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
