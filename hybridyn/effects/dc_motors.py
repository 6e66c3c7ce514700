"""DC motors: currents and voltages of efforts, and what supply and amplifier let a motor give."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar, NamedTuple

import numpy as np

from ..description.names import did_you_mean
from ..errors import AT_SAMPLE, ActuationError, ModelError
from ..spatial import Array, Index
from ..structure.robot import HybridRobot
from .joints import Numbers, given, positive


@dataclass(frozen=True)
class DcMotors:
    """Currents and voltages of DC motors, which limit what they give: the torque-speed line.

    A motor of gear ratio n (rotor turns per joint turn, from the robot's files, 1 where they state none) that
    gives tau needs

        i = tau / (n k)        u = R i + n k v        |u| <= voltage        |i| <= current

    n k v is the back-EMF. The direct model clips efforts to what both limits allow at the speed: at rest up
    to n k voltage / R, without load up to the speed voltage / (n k). The inverse model raises an error for a
    motion that needs more. The winding's inductance is left out: its time constant is that of the current's
    controller, far below that of a robot. Brushless motors behave alike, with k and R of line to line at a
    trapezoidal commutation.

    `torque_constant`: k by motor [N m/A], the same number as the back-EMF's in [V s/rad]; `resistance`: R by
    motor [Ohm]; `voltage`: of the supply, by motor [V]; `current`: largest, by motor [A]. Motors without a
    voltage or current have no such limit. Source: e.g. Hughes & Drury (2019), chapter 3.
    """

    torque_constant: Numbers = field(default_factory=dict)
    resistance: Numbers = field(default_factory=dict)
    voltage: Numbers = field(default_factory=dict)
    current: Numbers = field(default_factory=dict)
    name: ClassVar[str] = "dc_motors"


class OnDcMotors(NamedTuple):
    """The law applied to motors of one robot.

    Attributes:
        effect: The law.
        motors: Numbers of its motors.
        constant: n k of each motor, at the joint [N m/A or N/A].
        resistance: R of each motor [Ohm].
        voltage, current: Limits of each motor [V], [A]; inf where there is none.
    """

    effect: DcMotors
    motors: Index
    constant: Array
    resistance: Array
    voltage: Array
    current: Array

    def without_gears(self, robot: HybridRobot) -> list[str]:
        """Return the motors whose gear ratio is 1, which stands for none that is stated."""
        return [robot.motors[i] for i in self.motors if robot.records[robot.motors[i]].gear_ratio == 1]

    def currents(self, tau: Array) -> Array:
        """Compute the currents, shape (T, motors of the law), [A], from efforts, shape (T, motors)."""
        out: Array = tau[:, self.motors] / self.constant
        return out

    def voltages(self, tau: Array, speed: Array) -> Array:
        """Compute the voltages, shape (T, motors of the law), [V], from efforts and rates, (T, motors)."""
        return self.resistance * self.currents(tau) + self.constant * speed[:, self.motors]

    def clip(self, tau: Array, speed: Array) -> Array:
        """Clip efforts to what current and voltage allow at rates; both of shape (T, motors).

        The supply has the last word: where the back-EMF exceeds it, the motor brakes whatever is commanded.
        """
        out, own = tau.copy(), tau[:, self.motors]
        out[:, self.motors] = np.clip(own, *self.bounds(speed[:, self.motors]))
        return out

    def bounds(self, speed: Array) -> tuple[Array, Array]:
        """Return the least and the largest efforts that motors give at their rates, (T, motors of the law).

        They are infinite where nothing limits them.
        """
        per_ampere = np.abs(self.constant)
        peak, stall = per_ampere * self.current, per_ampere * self.voltage / self.resistance
        drag = self.constant**2 / self.resistance * speed
        least, most = (np.clip(sign * peak, -stall - drag, stall - drag) for sign in (-1.0, 1.0))
        return least, most

    def check(self, robot: HybridRobot, tau: Array, speed: Array) -> None:
        """Check that efforts need no more than current and voltage allow at rates; both (T, motors).

        Raises:
            ActuationError: One does; the message names motor and sample.
        """
        needs = (("A", self.currents(tau), self.current), ("V", self.voltages(tau, speed), self.voltage))
        for unit, needed, limit in needs:
            excess = np.abs(needed) - limit
            if not (excess > 0).any():
                continue
            t, i = np.unravel_index(int(np.argmax(excess)), excess.shape)
            motor, back = robot.motors[self.motors[i]], self.constant[i] * speed[t, self.motors[i]]
            more = f", of which the back-EMF is {back:.6g} V" if unit == "V" else ""
            raise ActuationError(
                f"{DcMotors.name}: motor '{motor}' would need {needed[t, i]:.6g} {unit}{AT_SAMPLE}{more}; "
                f"limit {limit[i]:.6g} {unit}. Slow the motion down, change the gear, or state no such limit",
                direction=motor, size=float(excess[t, i]), sample=int(t),
            )  # fmt: skip


def on_dc_motors(effect: DcMotors, robot: HybridRobot) -> OnDcMotors | None:
    """Find the law's motors in a robot; None if it has none.

    Raises:
        ModelError: A motor is unknown, lacks one of the numbers, or a number is not positive.
    """
    named = ("torque_constant", "resistance", "voltage", "current")
    tables: dict[str, Mapping[str, float]] = {word: getattr(effect, word) for word in named}
    for word, table in tables.items():
        for motor, number in table.items():
            if motor not in robot.motors:
                raise ModelError(
                    f"{effect.name}: there is no motor '{motor}'{did_you_mean(motor, robot.motors)}",
                    element=motor,
                )
            positive(effect.name, f"{word} of '{motor}'", number)
            if motor not in effect.torque_constant:
                raise ModelError(f"{effect.name}: motor '{motor}' has no torque_constant", element=motor)
    stated = given(effect.name, effect.torque_constant, effect.resistance)
    if not stated:
        return None
    motors = np.array([robot.motors.index(motor) for motor in stated])
    ratio = np.array([robot.records[motor].gear_ratio for motor in stated])
    constant, resistance = np.array([*stated.values()]).T
    voltage, current = (
        np.array([float(table.get(motor, np.inf)) for motor in stated])
        for table in (effect.voltage, effect.current)
    )
    return OnDcMotors(effect, motors, ratio * constant, resistance, voltage, current)
