"""Load of each motor over a motion: peaks, RMS, power and energy, accumulated block by block.

Means are those of `tables.over_time`:

    RMS effort = sqrt(1/T integral tau^2 dt),  mean power = 1/T integral tau q_dot dt.

All quantities refer to the joint side of the gear. With a gear ratio n the rotor turns at n q_dot with torque
tau / n. Losses of the gear are those of the effect
`gear_efficiency`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..description.records import Joint
from ..spatial import Array
from ..structure.robot import HybridRobot
from ..tables.over_time import Means, Peaks, places
from ..tables.signals import UNITS

#: Points of the speed-effort cloud kept per motor. Above twice this number, every second point is dropped.
CLOUD = 2000


class Peak(NamedTuple):
    """The value of largest magnitude of a quantity.

    Attributes:
        value: The value, with its sign.
        at: Its time [s], or its row number if the table has no time.
    """

    value: float
    at: float


@dataclass(frozen=True)
class MotorLoad:
    """Load of one motor. Efforts in N or N m, speeds in m/s or rad/s, powers in W, energies in J.

    Attributes:
        motor: Name of the driven joint.
        linear: Whether it is prismatic.
        effort: Peak effort.
        rms_effort: RMS effort.
        speed: Peak speed.
        rms_speed: RMS speed.
        power: Peak driving power.
        braking_power: Peak braking power, negative.
        mean_power: Mean net power (driving minus braking); None without time.
        energy_given: Energy delivered while driving; None without time.
        energy_taken: Energy absorbed while braking, positive; None without time.
        travel: Smallest and largest position [m or rad]; None for a continuous joint.
        effort_limit: Effort limit from the file, inf if it has none.
        speed_limit: Speed limit from the file, inf if it has none.
        lower_limit: Lower position limit from the file, -inf if it has none.
        upper_limit: Upper position limit from the file, inf if it has none.
        gear_ratio: Rotor turns per joint turn (rad/m for a prismatic joint).
    """

    motor: str
    linear: bool
    effort: Peak
    rms_effort: float
    speed: Peak
    rms_speed: float
    power: Peak
    braking_power: Peak
    mean_power: float | None
    energy_given: float | None
    energy_taken: float | None
    travel: tuple[float, float] | None
    effort_limit: float
    speed_limit: float
    lower_limit: float
    upper_limit: float
    gear_ratio: float

    def unit(self, quantity: str) -> str:
        """Return the unit of a quantity, such as "effort"."""
        return UNITS[quantity][not self.linear]

    @property
    def rotor_torque(self) -> float:
        """Peak torque of the rotor [N m]."""
        return abs(self.effort.value / self.gear_ratio)

    @property
    def rotor_rms_torque(self) -> float:
        """RMS torque of the rotor [N m]."""
        return abs(self.rms_effort / self.gear_ratio)

    @property
    def rotor_speed(self) -> float:
        """Peak speed of the rotor [rad/s]."""
        return abs(self.speed.value * self.gear_ratio)


class Sizing:
    """Loads of a robot's motors over a motion, accumulated block by block in time order."""

    def __init__(self, robot: HybridRobot, joints: Sequence[Joint] | None = None) -> None:
        """Start without samples.

        Args:
            joints: The motors; those of the robot by default. Motors of several designs may stand side by
                side, which changes no bit of their loads.
        """
        self.joints = [robot.records[name] for name in robot.motors] if joints is None else list(joints)
        count = len(self.joints)
        self.samples = 0
        self._peaks = {name: Peaks(count) for name in ("effort", "speed", "power", "braking")}
        self._means = Means()  # of effort^2, speed^2, power, positive power, negative power
        self._lower, self._upper = np.full(count, np.inf), np.full(count, -np.inf)
        self.cloud = _Cloud()

    @property
    def duration(self) -> float:
        """Time from the first sample to the last [s]; 0 without times."""
        return self._means.duration

    def add(self, time: Array | None, first_row: int, position: Array, speed: Array, effort: Array) -> None:
        """Add consecutive samples.

        Args:
            time: Times, shape (T,), [s], or None.
            first_row: Number of the first sample, used if there is no time.
            position: Positions of the motors, shape (T, motors), [m or rad], nan for continuous joints.
            speed: Rates of the motors, shape (T, motors), [m/s or rad/s].
            effort: Efforts of the motors, shape (T, motors), [N or N m].
        """
        power = effort * speed
        at = places(time, first_row, len(effort))
        for name, values in (
            ("effort", effort),
            ("speed", speed),
            ("power", np.maximum(power, 0.0)),
            ("braking", np.minimum(power, 0.0)),
        ):
            self._peaks[name].add(values, at)
        self._lower = np.minimum(self._lower, position.min(axis=0, initial=np.inf))
        self._upper = np.maximum(self._upper, position.max(axis=0, initial=-np.inf))
        self.samples += len(effort)
        self._means.add(time, _integrands(effort, speed))
        self.cloud.add(np.stack([speed, effort], axis=-1))

    def loads(self) -> list[MotorLoad]:
        """Compute the load of each motor from the samples so far."""
        timed = self.duration > 0
        shape = (5, len(self.joints))
        effort, speed, power, _, _ = np.broadcast_to(self._means.mean, shape)
        given, taken = np.broadcast_to(self._means.integral, shape)[3:]
        out = []
        for i, joint in enumerate(self.joints):
            peaks = {name: Peak(float(of.value[i]), float(of.at[i])) for name, of in self._peaks.items()}
            bounded = np.isfinite(self._lower[i]) and np.isfinite(self._upper[i])
            out.append(
                MotorLoad(
                    motor=joint.name,
                    linear=joint.kind.slides,
                    effort=peaks["effort"],
                    rms_effort=float(np.sqrt(effort[i])),
                    speed=peaks["speed"],
                    rms_speed=float(np.sqrt(speed[i])),
                    power=peaks["power"],
                    braking_power=peaks["braking"],
                    mean_power=float(power[i]) if timed else None,
                    energy_given=float(given[i]) if timed else None,
                    energy_taken=float(-taken[i]) if timed else None,
                    travel=(float(self._lower[i]), float(self._upper[i])) if bounded else None,
                    effort_limit=joint.effort_limit,
                    speed_limit=joint.speed_limit,
                    lower_limit=joint.lower,
                    upper_limit=joint.upper,
                    gear_ratio=joint.gear_ratio,
                )
            )
        return out


def motor_rows(robot: HybridRobot, q: Array, v: Array) -> tuple[Array, Array]:
    """Return positions and rates of the motors, shapes (..., motors); positions of continuous joints are nan.

    Args:
        q: Positions of the spanning tree, shape (..., nq).
        v: Rates, shape (..., nv).
    """
    position, speed = np.full((2, *q.shape[:-1], len(robot.motors)), np.nan)
    for i, name in enumerate(robot.motors):
        joint = robot.joint_index[name]
        speed[..., i] = v[..., robot.v_slices[joint].start]
        if not robot.kinds[joint].endless:
            position[..., i] = q[..., robot.q_slices[joint].start]
    return position, speed


class _Cloud:
    """Samples of speed and effort, thinned evenly."""

    def __init__(self) -> None:
        self._parts: list[Array] = []
        self._stride, self._seen, self._kept = 1, 0, 0

    def add(self, points: Array) -> None:
        """Add samples, shape (T, motors, 2)."""
        start = -self._seen % self._stride
        self._seen += len(points)
        self._parts.append(points[start :: self._stride])
        self._kept += len(self._parts[-1])
        while self._kept > 2 * CLOUD:
            self._parts = [self.points[::2]]
            self._stride *= 2
            self._kept = len(self._parts[0])

    @property
    def points(self) -> Array:
        """Speed and effort, shape (points, motors, 2)."""
        return np.concatenate(self._parts) if self._parts else np.zeros((0, 0, 2))


def _integrands(effort: Array, speed: Array) -> Array:
    """Compute the integrands, shape (T, 5, motors), from effort and speed, shape (T, motors)."""
    power = effort * speed
    parts = [effort**2, speed**2, power, np.maximum(power, 0.0), np.minimum(power, 0.0)]
    return np.stack(parts, axis=1)
