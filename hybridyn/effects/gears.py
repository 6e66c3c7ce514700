"""Losses of gears between motors and joints, in proportion to the effort that they transmit."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar, NamedTuple

import numpy as np

from ..description.names import did_you_mean
from ..errors import AT_SAMPLE, ActuationError, ModelError
from ..spatial import Array, Index
from ..structure.robot import HybridRobot
from .joints import WIDTH, Numbers, positive


@dataclass(frozen=True)
class GearEfficiency:
    """Efforts of motors behind gears that waste a part of what they transmit.

    A joint that is driven receives efficiency x the motor's effort. One that drives its motor needs of it
    back x the joint's effort: below zero the gear locks itself, and the motor has to help the load down.
    Between them the effort tau of the joint needs tau (1 / efficiency + back) / 2 +
    |tau| (1 / efficiency - back) / 2 tanh(v / width). Efforts of motors are those before the gear, in the
    joint's unit; rotors belong to the joint.

    `efficiency`: above 0 up to 1, by motor; `back`: up to 1, by motor; None: 2 - 1 / efficiency, as where the
    same friction acts both ways; `width` [m/s or rad/s]. Source: e.g. Niemann & Winter (1983), section 24.
    """

    efficiency: Numbers = field(default_factory=dict)
    back: Numbers | None = None
    width: float = WIDTH
    name: ClassVar[str] = "gear_efficiency"


class OnGears(NamedTuple):
    """The law applied to motors of one robot.

    Attributes:
        effect: The law.
        motors: Numbers of its motors.
        columns: Their freedoms in v.
        mean, half: Mean and half difference of what the motor needs per effort, driving and driven.
    """

    effect: GearEfficiency
    motors: Index
    columns: Index
    mean: Array
    half: Array

    def before(self, tau: Array, v: Array) -> Array:
        """Compute the efforts of motors from those of joints, shape (T, motors), and rates (T, nv)."""
        out = tau.copy()
        out[:, self.motors] = needed(self.mean, self._slopes(v), tau[:, self.motors])
        return out

    def behind(self, robot: HybridRobot, tau: Array, v: Array) -> Array:
        """Compute the efforts of joints from those of motors, shape (T, motors), and rates (T, nv).

        Raises:
            ActuationError: A gear locks itself: the motion does not follow from the motor's effort.
        """
        slope, out = self._slopes(v), tau.copy()
        least = self.mean - np.abs(slope)
        if (least <= 0).any():
            t, i = np.unravel_index(int(np.argmin(least)), least.shape)
            motor = robot.motors[self.motors[i]]
            raise ActuationError(
                f"{self.effect.name}: the gear of '{motor}' locks itself{AT_SAMPLE}: driven by its joint "
                f"it needs {least[t, i]:.4g} of the effort, and only above 0 the motion follows from the "
                "motor's effort. Raise back, or ask the inverse model for efforts",
                direction=motor, size=float(least[t, i]), sample=int(t),
            )  # fmt: skip
        out[:, self.motors] = passed_on(self.mean, slope, tau[:, self.motors])
        return out

    def _slopes(self, v: Array) -> Array:
        """Compute what the direction of motion adds, per size of the effort, shape (T, motors of the law)."""
        out: Array = slopes(self.half, v[:, self.columns], self.effect.width)
        return out


def slopes(half: Any, v: Any, width: Any) -> Any:
    """Compute what the direction of motion adds to the effort that a motor needs, per size of the effort.

    This and the next two run on numbers and symbols.
    """
    return half * np.tanh(v / width)


def needed(mean: Any, slope: Any, tau: Any) -> Any:
    """Compute the efforts of motors from those of joints."""
    return mean * tau + slope * np.abs(tau)


def passed_on(mean: Any, slope: Any, tau: Any) -> Any:
    """Compute the efforts of joints from those of motors, where the gear does not lock itself."""
    return tau / (mean + slope * np.sign(tau))


def on_gears(effect: GearEfficiency, robot: HybridRobot) -> OnGears | None:
    """Find the law's motors in a robot; None if it has none.

    Raises:
        ModelError: A motor is unknown, lacks one of the numbers, or a number is out of its range.
    """
    positive(effect.name, "width", effect.width)
    for motor in (*effect.efficiency, *(effect.back or {})):
        if motor not in robot.motors:
            raise ModelError(
                f"{effect.name}: there is no motor '{motor}'{did_you_mean(motor, robot.motors)}",
                element=motor,
            )
    pairs: list[tuple[float, float]] = []
    for motor, efficiency in effect.efficiency.items():
        if not 0 < efficiency <= 1:
            raise ModelError(
                f"{effect.name}: motor '{motor}': efficiency must be above 0 and at most 1, not "
                f"{efficiency:g}", element=motor,
            )  # fmt: skip
        back = 2 - 1 / efficiency if effect.back is None else effect.back.get(motor, np.nan)
        if not -np.inf < back <= 1:
            raise ModelError(
                f"{effect.name}: motor '{motor}': back must be a number of at most 1, not {back:g}",
                element=motor,
            )
        pairs.append((1 / efficiency, back))
    if odd := sorted({*(effect.back or {})} - {*effect.efficiency}):
        raise ModelError(f"{effect.name}: motor '{odd[0]}' has back and no efficiency", element=odd[0])
    if not pairs:
        return None
    motors = np.array([robot.motors.index(motor) for motor in effect.efficiency])
    drive, back_drive = np.array(pairs).T
    return OnGears(effect, motors, robot.motor_v[motors], (drive + back_drive) / 2, (drive - back_drive) / 2)
