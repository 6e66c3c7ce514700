"""Check whether a robot has derivatives over its motors."""

from __future__ import annotations

from ....description.names import counted
from ....errors import ModelError
from ....linkage.joints import NV
from ....structure.robot import HybridRobot

#: Known coordinates of derivatives.
COORDINATES = ("joints", "motors")


def check_known(coordinates: object) -> None:
    """Refuse coordinates that are unknown.

    Raises:
        ModelError: They are.
    """
    if not isinstance(coordinates, str) or coordinates not in COORDINATES:
        raise ModelError(f"coordinates of derivatives are 'joints' or 'motors', not {coordinates!r}")


def check_coordinates(robot: HybridRobot, model: str, coordinates: str) -> None:
    """Refuse coordinates that are unknown, or that the derivatives of a model of a robot cannot have.

    Raises:
        ModelError: They are unknown; the base has a prescribed motion, and the model is direct; or they are
            "motors", and the base is not fixed, or a module has not as many motors with one freedom as
            freedoms or one that its loops lock.
    """
    check_known(coordinates)
    if coordinates == "joints":
        if model == "ddm" and robot.base == "moving":
            raise ModelError(
                "derivatives of 'ddm' need a base that is fixed or floating; the motion of this one is "
                "prescribed. Differentiate 'idm', or load the robot with base='floating'"
            )
        return
    mend = "Use coordinates='joints'"
    if robot.base != "fixed":
        raise ModelError(f"derivatives over motors need a fixed base; this one is '{robot.base}'. {mend}")
    for module in robot.modules:
        motors = [robot.motors[i] for i in module.motor_index]
        several = [name for name in motors if NV[robot.kinds[robot.joint_index[name]]] > 1]
        if several:
            raise ModelError(f"motor '{several[0]}' has several freedoms and is no coordinate. {mend}")
        locked = [name for i, name in enumerate(motors) if i not in module.moving_motors]
        if locked:
            raise ModelError(
                f"module '{module.name}': its loops lock motor '{locked[0]}', which is no coordinate. {mend}",
                element=locked[0],
            )
        if len(motors) != module.mobility:
            raise ModelError(
                f"module '{module.name}': {counted(len(motors), 'motor')} for "
                f"{counted(module.mobility, 'freedom')} are not its independent coordinates. {mend}",
                element=module.name,
            )
