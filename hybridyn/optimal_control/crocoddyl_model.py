"""The differential action model of Crocoddyl over a robot's motors; importing this file imports Crocoddyl."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from ..effects.choice import Choice
from ..errors import required
from ..spatial import Array
from ..structure.robot import HybridRobot
from .closed_model import ClosedModel, ClosedState, first_posture, or_no_numbers

crocoddyl = required("crocoddyl", "crocoddyl", "the action model of Crocoddyl")


class MotorAction(crocoddyl.DifferentialActionModelAbstract):  # type: ignore[misc, name-defined]
    """Accelerations of the motors under their efforts, with the loops closed inside and exact derivatives.

    The state has positions and rates of the motors. Where no posture follows them, accelerations and
    derivatives are NaN, from which solvers step back, and the logger "hybridyn" says why.
    """

    def __init__(
        self, robot: HybridRobot, costs: Any, effects: Choice = None, *, start: Array | None = None
    ) -> None:
        """Join the direct model of a robot with costs.

        Args:
            robot: The robot, with a fixed base.
            costs: A `crocoddyl.CostModelSum` over a `crocoddyl.StateVector(2 * motors)` and the efforts.
            effects: Effects to include, as for `hybridyn.idm`.
            start: Posture that closes the loops, from which the motors of each node first move, shape (nq,);
                the home posture by default.

        Raises:
            ModelError, CompileError, TrajectoryError: As `hybridyn.casadi_model`.
        """
        super().__init__(costs.state, len(robot.motors), costs.nr)
        self.model, self.costs = ClosedModel(robot, "ddm", effects), costs
        self.start = first_posture(robot, start)

    def calc(self, data: MotorData, x: Array, u: Array | None = None) -> None:
        """Compute accelerations and cost; without efforts, as at the end, the cost alone."""
        if u is None:
            self.costs.calc(data.costs, x)
        else:
            data.state = None
            data.xout = or_no_numbers(partial(self._accelerations, data, x, u), u.shape)
            self.costs.calc(data.costs, x, u)
        data.cost = data.costs.cost

    def _accelerations(self, data: MotorData, x: Array, u: Array) -> Array:
        """Return the accelerations of the motors, and keep the state of all joints."""
        position, rate = np.split(x, 2)
        state = self.model.close(position, rate, u, data.posture)
        found = self.model.value(state)
        data.state, data.posture = state, state.q
        return found

    def calcDiff(self, data: MotorData, x: Array, u: Array | None = None) -> None:
        """Compute the derivatives of what `calc` has computed."""
        if u is None:
            self.costs.calcDiff(data.costs, x)
            return
        J, state = np.full((len(u), len(x) + len(u)), np.nan), data.state
        if state is not None:
            J = or_no_numbers(partial(self.model.jacobian, state), J.shape)
        data.Fx, data.Fu = J[:, : len(x)], J[:, len(x) :]
        self.costs.calcDiff(data.costs, x, u)

    def createData(self) -> MotorData:
        """Return data for one node."""
        return MotorData(self)


class MotorData(crocoddyl.DifferentialActionDataAbstract):  # type: ignore[misc, name-defined]
    """What a node computes, and the posture from which its motors move on.

    Attributes:
        posture: Of the last state that closed the loops, shape (nq,).
        state: That of `calc`; None where no posture follows.
    """

    def __init__(self, action: MotorAction) -> None:
        """Share the memory of the costs."""
        super().__init__(action)
        self.posture: Array = action.start
        self.state: ClosedState | None = None
        self.costs = action.costs.createData(crocoddyl.DataCollectorAbstract())
        self.costs.shareMemory(self)
