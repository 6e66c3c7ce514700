"""Controllers: functions of (t, q, v) that return the motors' efforts."""

from __future__ import annotations

import importlib.util
import logging
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..compiled import Law, Pieces, torque_models
from ..description.names import did_you_mean
from ..dynamics.inverse import inverse_model
from ..effects.choice import Choice, choose
from ..effects.links import table
from ..errors import HybridynError, ModelError
from ..simulation.motion_law import Effort
from ..spatial import Array
from ..structure.robot import HybridRobot
from .references import MotorAxes, Reference

if TYPE_CHECKING:
    from ..compiled import CompiledRobot

log = logging.getLogger("hybridyn.scenes")

Gains = float | Mapping[str, float]


def by_motor(robot: HybridRobot, what: str, numbers: Gains) -> Array:
    """Return one number per motor, shape (motors,).

    Raises:
        ModelError: An unknown motor, one without a number, or a number that is negative or not finite.
    """
    if isinstance(numbers, Mapping):
        out = constant(robot, numbers, what)
        absent = [name for name in robot.motors if name not in numbers]
        if absent:
            raise ModelError(f"{what}: motor '{absent[0]}' has no number", element=absent[0])
    else:
        out = np.full(len(robot.motors), float(numbers))
    if not (np.isfinite(out).all() and (out >= 0).all()):
        raise ModelError(f"{what}: numbers must be finite and not negative")
    return out


class EffortTable:
    """Efforts over time, interpolated linearly between the rows of a table."""

    def __init__(self, time: Array, tau: Array) -> None:
        """Check the table.

        Args:
            time: Times, shape (rows,), [s].
            tau: Efforts in the order of `robot.motors`, shape (rows, motors), [N or N m].

        Raises:
            ModelError: Shapes are wrong, numbers are not finite, or times do not increase.
        """
        self.time, self.tau = table("efforts", time, tau, np.shape(tau)[-1])
        c = np.zeros((len(self.time), 6, self.tau.shape[1]))
        c[:, 0] = self.tau
        c[:-1, 1] = np.diff(self.tau, axis=0) / np.diff(self.time)[:, None]
        self._pieces = Pieces(self.time, np.ones(len(self.time)), c, False)

    def __call__(self, t: float, q: Array, v: Array) -> Array:
        """Return the efforts at a time, shape (motors,).

        Raises:
            TrajectoryError: The time is outside the table.
        """
        times = np.array([t])
        self._pieces.check("efforts: its table", times)
        tau: Array = self._pieces.at(times)[0][0]
        return tau

    def in_c(self, compiled: CompiledRobot) -> Law | None:
        """Return the table for steps in C."""
        return Law.table(self._pieces)


class Pd:
    """Proportional-derivative control of each motor: tau = kp (x_d - x) + kd (x_d' - x')."""

    def __init__(self, robot: HybridRobot, reference: Reference, kp: Gains, kd: Gains) -> None:
        """Set motors, reference and gains.

        Args:
            robot: The robot.
            reference: The reference motion x_d.
            kp: Stiffness, for all or by motor [N/m or N m/rad].
            kd: Damping, for all or by motor [N s/m or N m s/rad].

        Raises:
            ModelError: Unknown motors, or negative gains.
        """
        self._robot, self._axes, self._reference = robot, MotorAxes.of(robot), reference
        self._kp, self._kd = by_motor(robot, "kp", kp), by_motor(robot, "kd", kd)

    def _feedback(self, t: float, q: Array, v: Array) -> tuple[Array, Array]:
        """Return kp (x_d - x) + kd (x_d' - x') and x_d'', shape (motors,) each."""
        x, x_dot, x_ddot = self._reference.at(t)
        return self._kp * self._axes.error(x, q) + self._kd * (x_dot - v[self._axes.columns]), x_ddot

    def __call__(self, t: float, q: Array, v: Array) -> Array:
        """Return the efforts, shape (motors,)."""
        return self._feedback(t, q, v)[0]

    def in_c(self, compiled: CompiledRobot) -> Law | None:
        """Return the control for steps in C."""
        return Law.tracking(self._reference.pieces, self._axes, (self._kp, self._kd))


class ComputedTorque(Pd):
    """The inverse model of the accelerations x_d'' + kd (x_d' - x') + kp (x_d - x) of the motors.

    Errors decay as in a linear system if the controller's effects are those that act. Joints without a motor
    move under zero effort. Source: Khalil & Dombre (2002), section 14.4.
    """

    def __init__(
        self, robot: HybridRobot, reference: Reference, kp: Gains, kd: Gains, effects: Choice = None
    ) -> None:
        """Set motors, reference, gains and effects.

        Args:
            robot: The robot.
            reference: The reference motion x_d.
            kp: Gain of the position error, for all or by motor [1/s^2].
            kd: Gain of the rate error, for all or by motor [1/s].
            effects: The effects in the controller's model, as in `idm`; limits are left out.

        Raises:
            ModelError: Unknown motors or effects, or negative gains.
        """
        super().__init__(robot, reference, kp, kd)
        self._on = choose(robot, effects).unbounded

    def __call__(self, t: float, q: Array, v: Array) -> Array:
        """Return the efforts, shape (motors,)."""
        feedback, x_ddot = self._feedback(t, q, v)
        a = np.zeros(self._robot.nv)
        a[self._axes.columns] = x_ddot + feedback
        found = inverse_model(self._robot, q, v, a, effects=self._on, time=t, passive="solved")
        tau: Array = found.values[0]
        return tau

    def in_c(self, compiled: CompiledRobot) -> Law | None:
        """Return the control for steps in C; None for idle joints besides redundant motors or a moving base.

        The first call for a robot, and for effects other than those that act, builds programs.
        """
        if compiled.robot is not self._robot:
            return None
        try:
            programs = torque_models(compiled, self._on)
        except HybridynError as error:
            log.warning("computed torque is evaluated in Python, which takes longer: %s", error)
            return None
        if programs is None:
            return None
        return Law.tracking(self._reference.pieces, self._axes, (self._kp, self._kd), programs)


def constant(robot: HybridRobot, numbers: Mapping[str, float], what: str = "efforts") -> Array:
    """Return constant efforts by motor as an array, zero where not named, shape (motors,).

    Raises:
        ModelError: An unknown motor.
    """
    for name in numbers:
        if name not in robot.motors:
            raise ModelError(
                f"{what}: there is no motor '{name}'{did_you_mean(name, robot.motors)}", element=name
            )
    return np.array([float(numbers.get(name, 0.0)) for name in robot.motors])


def from_file(robot: HybridRobot, path: str, function: str) -> Effort:
    """Run a Python file, call its `function(robot)`, and return the resulting law of (t, q, v).

    The file runs with all rights of this process: use trusted files only.

    Raises:
        ModelError: There is no such file or function, it fails, or its result is not callable.
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
