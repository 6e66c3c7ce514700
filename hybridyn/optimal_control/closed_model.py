"""A model over the motors, which every other joint follows, with its first two derivatives in C."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..compiled import Derivatives, SecondDerivatives, compile
from ..effects.choice import Choice
from ..errors import HybridynError
from ..logs import warn
from ..spatial import Array
from ..structure.robot import HybridRobot
from ..structure.samples import as_positions


def first_posture(robot: HybridRobot, start: Array | None) -> Array:
    """Return the posture from which motors move, shape (nq,): the home posture by default.

    Raises:
        TrajectoryError: `start` has a wrong shape or is not finite.
    """
    return robot.home if start is None else as_positions(robot, start, "start")[0][0]


def or_no_numbers(compute: Callable[[], Array], shape: tuple[int, ...]) -> Array:
    """Compute what a solver asks for; NaN and a warning where no posture follows, or rank is lost."""
    try:
        return compute()
    except HybridynError as error:
        warn("no numbers for the solver: %s", error)
        return np.full(shape, np.nan)


class ClosedState(NamedTuple):
    """What a model reads, of all joints: positions, rates, and accelerations or motor efforts."""

    q: Array
    v: Array
    x: Array


class ClosedModel:
    """One model of one robot over its motors: the loops are closed before each evaluation.

    Arrays over motors have the shape (motors,) or (T, motors).
    """

    def __init__(self, robot: HybridRobot, model: str, effects: Choice = None) -> None:
        """Prepare the model and its derivatives.

        Args:
            robot: The robot.
            model: "idm" or "ddm".
            effects: Effects to include, as for `hybridyn.idm`.

        Raises:
            ModelError, CompileError, SingularityError: As `hybridyn.SecondDerivatives` over motors and
                `hybridyn.compile`.
        """
        self._second = SecondDerivatives(robot, model, effects, coordinates="motors")
        self._first = Derivatives(robot, model, effects, coordinates="motors")
        self._compiled, self._inverse = compile(robot, effects, wait=False), model == "idm"
        self.robot = robot

    def close(self, position: Array, rate: Array, x: Array, last: Array) -> ClosedState:
        """Return the state of all joints; rows follow each other from the posture `last`, shape (nq,).

        Args:
            position: Positions of the motors [m or rad].
            rate: Their rates.
            x: Their accelerations, for "idm", or efforts.
            last: A posture that closes the loops.

        Raises:
            HybridynError: As `CompiledRobot.close`.
        """
        q, v, a = self._compiled.close(position, rate, x if self._inverse else None, last=last)
        return ClosedState(q, v, a if self._inverse else x)

    def value(self, state: ClosedState) -> Array:
        """Return efforts, or accelerations of the motors.

        Raises:
            HybridynError: As `CompiledRobot.idm` or `ddm`.
        """
        if self._inverse:
            return self._compiled.idm(*state)
        return self._compiled.ddm(*state)[..., self.robot.motor_v]

    def jacobian(self, state: ClosedState) -> Array:
        """Return the derivatives over positions, rates and x side by side, shape ([T,] motors, 3 motors).

        Raises:
            HybridynError: As `hybridyn.ddm_jacobian`.
        """
        return np.concatenate([*self._first(*state).values()], axis=-1)

    def hessian(self, state: ClosedState, weights: ArrayLike) -> Array:
        """Return those of weights^T result of second order, shape ([T,] 3 motors, 3 motors).

        Raises:
            HybridynError: As `SecondDerivatives.hessian`.
        """
        return self._second.hessian(*state, weights)
