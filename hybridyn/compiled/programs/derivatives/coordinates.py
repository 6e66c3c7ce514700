"""Check whether a robot has derivatives over its motors."""

from __future__ import annotations

import numpy as np

from ....description.names import counted
from ....errors import ModelError
from ....linkage.joints import NV
from ....structure.robot import HybridRobot

#: Known coordinates of derivatives.
COORDINATES = ("joints", "motors")


def check_kinds(coordinates: object, parameters: object) -> None:
    """Refuse what `idm_jacobian` and `ddm_jacobian` do not know.

    Raises:
        ModelError: The coordinates are unknown, or `parameters` is neither true nor false.
    """
    if not isinstance(coordinates, str) or coordinates not in COORDINATES:
        raise ModelError(f"coordinates of derivatives are 'joints' or 'motors', not {coordinates!r}")
    if not isinstance(parameters, int | np.bool_):
        raise ModelError(
            "parameters of derivatives are True (the ten inertial parameters of each body) or False, not "
            f"{parameters!r}"
        )


def check_coordinates(robot: HybridRobot, coordinates: str, *, parameters: bool) -> None:
    """Refuse coordinates that are unknown, or that the robot's derivatives cannot have.

    Raises:
        ModelError: They are unknown; or they are "motors", and the base is not fixed, a module has not as
            many motors with one freedom as freedoms or one that its loops lock, or derivatives over
            parameters are asked for.
    """
    check_kinds(coordinates, parameters)
    if coordinates == "joints":
        return
    mend = "Use coordinates='joints'"
    if parameters:
        raise ModelError(f"derivatives over parameters are not available with coordinates='motors'. {mend}")
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
