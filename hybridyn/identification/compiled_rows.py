"""Rows of the regressor by compiled models: inertial columns in C, those of laws beside them."""

import numpy as np

from ..compiled import InertialColumns
from ..effects.words import DEFAULT
from ..errors import CompileError
from ..spatial import Array, Index
from ..structure.robot import HybridRobot
from .regressor import add_laws, effort_rows
from .standard import StandardParameters


class CompiledRows:
    """Some columns of Y of one robot, in C where the model can be trusted.

    Attributes:
        robot: The robot.
        parameters: Its standard parameters.
        columns: Parameters whose columns are computed.
    """

    def __init__(self, robot: HybridRobot, parameters: StandardParameters, columns: Index) -> None:
        """Load the library from the cache, or build it and compare it with the general path.

        Raises:
            CompileError: There is no compiler or no CasADi, or a law acts on a joint without a motor.
            ModelError: An effect is not available in compiled models.
        """
        self.robot, self.parameters, self.columns = robot, parameters, np.asarray(columns, dtype=int)
        self._inertial = np.flatnonzero(np.isin(self.columns, parameters.tens))
        driven = [m.mobility == len(m.motors) == len(m.moving_motors) for m in robot.modules]
        odd = {joint for term in parameters.terms for joint in term.joints}.difference(robot.motors)
        if parameters.terms and (odd or not all(driven)):
            raise CompileError("laws on joints without a motor have no columns in compiled regressors")
        places = [*parameters.bodies.items(), *parameters.payloads]
        inertial = self.columns[self._inertial]

        def general(q: Array, v: Array, a: Array) -> Array:
            return effort_rows(robot, parameters, q, v, a)[..., inertial]

        self._in_c = InertialColumns(
            robot, places, parameters.effects.only(DEFAULT), inertial, general, parameters.values
        )

    def __call__(self, q: Array, v: Array, a: Array) -> Array:
        """Compute the columns, shape (T, motors, k), from checked arrays, (T, nq), (T, nv) and (T, nv).

        Raises:
            AssemblyError, SingularityError: As `regressor`, for samples that the code hands over.
        """
        Y = np.zeros((len(q), len(self.robot.motors), len(self.columns)))
        Y[..., self._inertial], trusted = self._in_c(q, v, a)
        add_laws(Y, self.robot, self.parameters, self.columns, q, v, a)
        doubtful = np.flatnonzero(~trusted)
        if len(doubtful):
            at = q[doubtful], v[doubtful], a[doubtful]
            Y[doubtful] = effort_rows(self.robot, self.parameters, *at)[..., self.columns]
        return Y
