"""The differential action model of Crocoddyl over a robot's motors; importing this file imports Crocoddyl."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..effects.choice import Choice
from ..errors import HybridynError, required
from ..logs import warn
from ..spatial import Array
from ..structure.robot import HybridRobot
from .closed_model import ClosedModel, ClosedState, first_posture

crocoddyl = required("crocoddyl", "crocoddyl", "the action model of Crocoddyl")


class MotorAction(crocoddyl.DifferentialActionModelAbstract):  # type: ignore[misc, name-defined]
    """Accelerations of the motors under their efforts, with the loops closed inside and exact derivatives.

    The state has positions and rates of the motors. Where no posture follows them, accelerations are NaN,
    from which solvers step back, and the logger "hybridyn" says why.
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
            position, rate = np.split(x, 2)
            try:
                data.state = self.model.close(position, rate, u, data.state.q)
                data.xout = self.model.value(data.state)
            except HybridynError as error:
                warn("no numbers for the solver: %s", error)
                data.xout = np.full(len(u), np.nan)
            self.costs.calc(data.costs, x, u)
        data.cost = data.costs.cost

    def calcDiff(self, data: MotorData, x: Array, u: Array | None = None) -> None:
        """Compute the derivatives of what `calc` has computed."""
        if u is None:
            self.costs.calcDiff(data.costs, x)
            return
        J = self.model.jacobian(data.state)
        data.Fx, data.Fu = J[:, : len(x)], J[:, len(x) :]
        self.costs.calcDiff(data.costs, x, u)

    def createData(self) -> MotorData:
        """Return data for one node."""
        return MotorData(self)


class MotorData(crocoddyl.DifferentialActionDataAbstract):  # type: ignore[misc, name-defined]
    """What a node computes, and the posture from which its motors move on."""

    def __init__(self, action: MotorAction) -> None:
        """Share the memory of the costs."""
        super().__init__(action)
        self.state = ClosedState(action.start, np.zeros(0), np.zeros(0))
        self.costs = action.costs.createData(crocoddyl.DataCollectorAbstract())
        self.costs.shareMemory(self)
