"""What DC motors take from their supply over a motion, accumulated block by block."""

from typing import NamedTuple

import numpy as np

from ..effects.dc_motors import OnDcMotors
from ..spatial import Array
from ..structure.robot import HybridRobot
from ..tables.over_time import Means, Peaks, places
from .sizing import Peak


class SupplyLoad(NamedTuple):
    """Currents and voltages of one DC motor.

    Attributes:
        motor: Name of the driven joint.
        current: Peak current [A].
        rms_current: RMS current, which its continuous current has to exceed [A].
        voltage: Peak voltage, back-EMF included [V].
        heat: Mean power lost in the winding [W].
        current_limit, voltage_limit: Limits, inf where there is none [A], [V].
    """

    motor: str
    current: Peak
    rms_current: float
    voltage: Peak
    heat: float
    current_limit: float
    voltage_limit: float


class SupplyLoads:
    """Currents and voltages of a robot's DC motors over a motion."""

    def __init__(self, robot: HybridRobot, law: OnDcMotors) -> None:
        self.motors, self.law = [robot.motors[i] for i in law.motors], law
        self._peaks, self._squares = Peaks(2 * len(self.motors)), Means()

    def add(self, time: Array | None, first_row: int, speed: Array, effort: Array) -> None:
        """Add consecutive samples, as `Sizing.add`."""
        current, voltage = self.law.currents(effort), self.law.voltages(effort, speed)
        at = places(time, first_row, len(effort))
        self._peaks.add(np.concatenate([current, voltage], axis=1), at)
        self._squares.add(time, current**2)

    def loads(self) -> list[SupplyLoad]:
        """Return the load of each DC motor from the samples so far."""
        peaks = [Peak(float(x), float(at)) for x, at in zip(self._peaks.value, self._peaks.at, strict=True)]
        squares, count = np.broadcast_to(self._squares.mean, len(self.motors)), len(self.motors)
        return [
            SupplyLoad(
                motor, peaks[i], float(np.sqrt(squares[i])), peaks[count + i],
                float(self.law.resistance[i] * squares[i]), float(self.law.current[i]),
                float(self.law.voltage[i]),
            )
            for i, motor in enumerate(self.motors)
        ]  # fmt: skip
