"""Controllers: functions of (t, q, v) that give the motors' efforts."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from ..description.names import did_you_mean
from ..dynamics.inverse import idm
from ..effects.choice import Choice, choose
from ..effects.links import at_times, table
from ..errors import ModelError
from ..simulation.motion_law import Effort
from ..spatial import Array
from ..structure.robot import HybridRobot
from .references import MotorAxes, Reference

Gains = float | Mapping[str, float]


def by_motor(robot: HybridRobot, what: str, numbers: Gains) -> Array:
    """Return one number per motor, shape (motors,).

    Args:
        robot: The robot.
        what: What the numbers are, for messages.
        numbers: One for all, or each motor's own.

    Raises:
        ModelError: An unknown motor, one without a number, or a number that is negative or not finite.
    """
    if isinstance(numbers, Mapping):
        for name in numbers:
            if name not in robot.motors:
                raise ModelError(
                    f"{what}: there is no motor '{name}'{did_you_mean(name, robot.motors)}", element=name
                )
        absent = [name for name in robot.motors if name not in numbers]
        if absent:
            raise ModelError(f"{what}: motor '{absent[0]}' has no number", element=absent[0])
        out = np.array([float(numbers[name]) for name in robot.motors])
    else:
        out = np.full(len(robot.motors), float(numbers))
    if not (np.isfinite(out).all() and (out >= 0).all()):
        raise ModelError(f"{what}: numbers must be finite and not negative")
    return out


class EffortTable:
    """Efforts over time, linear between the rows of a table."""

    def __init__(self, time: Array, tau: Array) -> None:
        """Keep the table.

        Args:
            time: Times, shape (rows,), [s].
            tau: Efforts in the order of `robot.motors`, shape (rows, motors), [N or N m].

        Raises:
            ModelError: Wrong shapes, not finite, or times that do not grow.
        """
        self.time, self.tau = table("efforts", time, tau, np.shape(tau)[-1])

    def __call__(self, t: float, q: Array, v: Array) -> Array:
        """Return the efforts at a time, shape (motors,).

        Raises:
            TrajectoryError: The table does not reach that far.
        """
        at_times("efforts", self.time, np.array([t]))
        return np.array([np.interp(t, self.time, column) for column in self.tau.T])


class Pd:
    """Motors on springs and dampers: tau = kp (x_d - x) + kd (x_d' - x'), each motor on its own."""

    def __init__(self, robot: HybridRobot, reference: Reference, kp: Gains, kd: Gains) -> None:
        """Find the motors.

        Args:
            robot: The robot.
            reference: The wanted motion x_d.
            kp: Stiffness, for all or by motor [N/m or N m/rad].
            kd: Damping, for all or by motor [N s/m or N m s/rad].

        Raises:
            ModelError: Unknown motors, or negative gains.
        """
        self._axes, self._reference = MotorAxes.of(robot), reference
        self._kp, self._kd = by_motor(robot, "kp", kp), by_motor(robot, "kd", kd)

    def __call__(self, t: float, q: Array, v: Array) -> Array:
        """Return the efforts, shape (motors,)."""
        x, x_dot, _ = self._reference.at(t)
        out: Array = self._kp * self._axes.behind(x, q) + self._kd * (x_dot - v[self._axes.columns])
        return out


class ComputedTorque:
    """The inverse model of the accelerations x_d'' + kd (x_d' - x') + kp (x_d - x) of the motors.

    Errors then decay as those of a linear system, as far as the effects that the controller knows are those
    that act. Motions without a motor follow from zero effort. Source: Khalil & Dombre (2002), section 14.4.
    """

    def __init__(
        self, robot: HybridRobot, reference: Reference, kp: Gains, kd: Gains, effects: Choice = None
    ) -> None:
        """Find the motors and the effects.

        Args:
            robot: The robot.
            reference: The wanted motion x_d.
            kp: For all or by motor [1/s^2].
            kd: For all or by motor [1/s].
            effects: The effects that the controller knows, as `idm` takes them; limits do not count.

        Raises:
            ModelError: Unknown motors or effects, or negative gains.
        """
        self._robot, self._axes, self._reference = robot, MotorAxes.of(robot), reference
        self._kp, self._kd = by_motor(robot, "kp", kp), by_motor(robot, "kd", kd)
        on = choose(robot, effects)
        self._on = on.only([name for name in on.names if name != "limits"])

    def __call__(self, t: float, q: Array, v: Array) -> Array:
        """Return the efforts, shape (motors,)."""
        x, x_dot, x_ddot = self._reference.at(t)
        late = self._kp * self._axes.behind(x, q) + self._kd * (x_dot - v[self._axes.columns])
        a = np.zeros(self._robot.nv)
        a[self._axes.columns] = x_ddot + late
        return idm(self._robot, q, v, a, effects=self._on, time=t, passive="solved")


def constant(robot: HybridRobot, efforts: Mapping[str, float]) -> Array:
    """Return constant efforts by motor as an array, zero where not named, shape (motors,).

    Raises:
        ModelError: An unknown motor.
    """
    for name in efforts:
        if name not in robot.motors:
            raise ModelError(f"there is no motor '{name}'{did_you_mean(name, robot.motors)}", element=name)
    return np.array([float(efforts.get(name, 0.0)) for name in robot.motors])


def from_file(robot: HybridRobot, path: str, function: str) -> Effort:
    """Run a Python file, call its `function(robot)`, and give the law of (t, q, v) that this returns.

    The file runs with every right of this process: only files that are trusted may come here.

    Raises:
        ModelError: There is no such file or function, it fails, or gives nothing that can be called.
    """
    spec = importlib.util.spec_from_file_location(Path(path).stem, path)
    if spec is None or spec.loader is None or not Path(path).is_file():
        raise ModelError("there is no such Python file", file=path)
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
        make: Callable[[HybridRobot], Effort] = getattr(module, function)
        law = make(robot)
    except Exception as error:
        raise ModelError(f"'{function}': {type(error).__name__}: {error}", file=path) from error
    if not callable(law):
        raise ModelError(f"'{function}' must return a function of (t, q, v), not {law!r}", file=path)
    return law
