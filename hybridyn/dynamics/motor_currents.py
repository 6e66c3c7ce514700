"""What DC motors take from their supply for efforts that they give."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..effects.choice import Choice, choose
from ..effects.dc_motors import DcMotors
from ..errors import ModelError
from ..spatial import Array
from ..structure.robot import HybridRobot
from ..structure.samples import as_efforts, as_rates, same_samples


@dataclass(frozen=True, eq=False)
class MotorCurrents:
    """Currents, voltages and powers of DC motors, of which supplied = mechanical + heat.

    Attributes:
        motors: Names of the motors.
        current: Currents, shape (motors,) or (T, motors), [A].
        voltage: Voltages at the terminals, back-EMF included, same shape, [V].
        supplied: Electrical power, same shape, [W]; negative where the motor feeds its supply.
        heat: Power lost in the windings, R current^2, same shape, [W].

    Example:
        >>> robot = hybridyn.load("five_bar")
        >>> k, R = (dict.fromkeys(robot.motors, x) for x in (0.1, 2.0))
        >>> dc = hybridyn.effects.DcMotors(torque_constant=k, resistance=R)
        >>> found = hybridyn.motor_currents(robot, [1.0, 0.0, 0.0, 0.0], [0.5, 0.0], effects=[dc])
        >>> bool(found.supplied[0] == 0.5 * 1.0 + found.heat[0])
        True
    """

    motors: tuple[str, ...]
    current: Array
    voltage: Array
    supplied: Array
    heat: Array


def motor_currents(
    robot: HybridRobot, v: ArrayLike, tau: ArrayLike, *, effects: Choice = "model"
) -> MotorCurrents:
    """Compute the currents and voltages with which DC motors give efforts; no limit is checked.

    Args:
        robot: The robot.
        v: Rates of the spanning tree, shape (nv,) or (T, nv), [m/s, rad/s].
        tau: Efforts of motors, as `hybridyn.idm` returns and `hybridyn.ddm` takes them, shape (motors,) or
            (T, motors), [N or N m].
        effects: Effects with "dc_motors" among them; "model": those of the robot's files.

    Raises:
        ModelError: Effects are unknown, or "dc_motors" is not among them.
        TrajectoryError: An array has the wrong shape or is not finite.

    Example:
        >>> robot = hybridyn.load("five_bar")
        >>> k, R = (dict.fromkeys(robot.motors, x) for x in (0.1, 2.0))
        >>> dc = hybridyn.effects.DcMotors(torque_constant=k, resistance=R)
        >>> found = hybridyn.motor_currents(robot, [1.0, 0.0, 0.0, 0.0], [0.5, 0.0], effects=[dc])
        >>> found.current, found.voltage.round(3), found.heat
        (array([0.5, 0. ]), array([2., 0.]), array([0.5, 0. ]))
    """
    law = choose(robot, effects).dc
    if law is None:
        raise ModelError(
            f"motor_currents needs the effect '{DcMotors.name}': name it with numbers, or state "
            f"[effects.{DcMotors.name}] in model.toml", element=DcMotors.name,
        )  # fmt: skip
    v, single = as_rates(robot, v)
    tau = as_efforts(robot, tau)[0]
    same_samples(v=v, tau=tau)
    current, voltage = law.currents(tau), law.voltages(tau, v[:, robot.motor_v])
    each = (current, voltage, current * voltage, law.resistance * np.square(current))
    names = tuple(robot.motors[i] for i in law.motors)
    return MotorCurrents(names, *(x[0] if single else x for x in each))
