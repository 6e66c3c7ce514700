"""Derivatives of both dynamic models, exact to rounding: CasADi differentiates the written-out models.

Positions are differentiated along the joints' own freedoms: a column of "q" belongs to a freedom of v, so
that cosine-sine pairs and quaternions need no care. The formulas that are differentiated hold where the loops
are closed. Along motions that keep them closed (q, v, a changing as the loops demand) the derivatives are
those of the models; taken column by column they also depend on which closing rows were eliminated.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..effects.choice import Choice
from ..errors import CompileError
from ..joints import NV
from ..leg_model import pinocchio_inertia
from ..robot import HybridRobot
from ..spatial import Array
from .needs import WITHOUT_CASADI

try:
    import casadi as ca

    from .expressions import unpack
    from .interpreter import function_of
    from .programs import programs
    from .rigid import quaternion_matrix
except ModuleNotFoundError as error:
    raise CompileError(WITHOUT_CASADI) from error

Jacobians = dict[str, Array]


def idm_jacobian(
    robot: HybridRobot, q: ArrayLike, v: ArrayLike, a: ArrayLike, *, effects: Choice = None
) -> Jacobians:
    """Give the derivatives of motor efforts.

    Args:
        robot: The robot.
        q: Positions, shape (nq,) or (T, nq).
        v: Rates, shape (nv,) or (T, nv), [m/s, rad/s].
        a: Accelerations, shape (nv,) or (T, nv), [m/s^2, rad/s^2].
        effects: As `hybridyn.idm` takes them.

    Returns:
        "q", "v", "a": d tau over the freedoms of q, over v and over a, shapes ([T,] motors, nv);
        "parameters": over ten inertial parameters of each body of `robot.bodies`, shape (motors, 10 bodies).

    Raises:
        ModelError: An effect is not for written-out models.
    """
    return Derivatives(robot, "idm", effects)(q, v, a)


def ddm_jacobian(
    robot: HybridRobot, q: ArrayLike, v: ArrayLike, tau: ArrayLike, *, effects: Choice = None
) -> Jacobians:
    """Give the derivatives of accelerations.

    Args:
        robot: The robot.
        q: Positions, shape (nq,) or (T, nq).
        v: Rates, shape (nv,) or (T, nv), [m/s, rad/s].
        tau: Motor efforts, shape (motors,) or (T, motors), [N or N m].
        effects: As `hybridyn.ddm` takes them.

    Returns:
        "q", "v": d a over the freedoms of q and over v, shape (nv, nv) or (T, nv, nv); "tau": (nv, motors);
        "parameters": over ten inertial parameters of each body of `robot.bodies`, shape (nv, 10 bodies).

    Raises:
        ModelError: An effect is not for written-out models.
    """
    return Derivatives(robot, "ddm", effects)(q, v, tau)


class Derivatives:
    """The derivatives of one model of one robot, prepared once and evaluated often."""

    def __init__(self, robot: HybridRobot, model: str, effects: Choice = None) -> None:
        """Write the model out and differentiate it.

        Args:
            robot: The robot.
            model: "idm" or "ddm".
            effects: As `hybridyn.idm` takes them.
        """
        program = programs(robot, effects, models=(model,), parameters=True)[model]
        self._function = function_of(program)
        names = [name for name, _ in program.inputs]
        columns = [ca.SX.sym(name, size) for name, size in program.inputs]
        out = self._function.call(columns)[0]
        blocks = []
        for name, column in zip(names, columns, strict=True):
            J = ca.jacobian(out, column)
            blocks.append(J @ _tangent(robot, column) if name == "q" else J)
        self._jacobian = ca.Function(
            f"{model}_jacobian", columns, blocks, names, [f"d_{name}" for name in names]
        )
        self._names = names
        self._parameters = np.concatenate(
            [pinocchio_inertia(body).toDynamicParameters() for body in robot.bodies.bodies]
        )

    @property
    def casadi(self) -> ca.Function:
        """The derivatives as a CasADi function, inputs and outputs named."""
        return self._jacobian

    def __call__(self, *given: ArrayLike) -> Jacobians:
        """Evaluate at one sample or many; arguments as the model's, shapes (n,) or (T, n)."""
        arrays = [np.asarray(x, dtype=float) for x in given]
        single = arrays[0].ndim == 1
        rows = zip(*(np.atleast_2d(x) for x in arrays), strict=True)
        samples = [self._one(list(row)) for row in rows]
        out = {name: np.array([sample[i] for sample in samples]) for i, name in enumerate(self._names)}
        return {name: value[0] for name, value in out.items()} if single else out

    def _one(self, given: list[Array]) -> list[Array]:
        """Evaluate at one sample."""
        still: list[Any] = [np.zeros(6)] if "base_acceleration" in self._names and len(given) == 3 else []
        return [np.array(J) for J in self._jacobian.call([*given, *still, self._parameters])]


def _tangent(robot: HybridRobot, q: ca.SX) -> ca.SX:
    """Give dq over the freedoms, shape (nq, nv): how coordinates change as joints move."""
    E = ca.SX(robot.nq, robot.nv)
    for kind, at, to in zip(robot.kinds, robot.q_slices, robot.v_slices, strict=True):
        x = q[at.start : at.stop]
        if kind in ("revolute", "prismatic"):
            block = ca.SX(1)
        elif kind == "continuous":
            block = ca.vertcat(-x[1], x[0])
        elif kind == "planar":
            c, s = x[2], x[3]
            block = ca.vertcat(
                ca.horzcat(c, -s, 0), ca.horzcat(s, c, 0), ca.horzcat(0, 0, -s), ca.horzcat(0, 0, c)
            )
        elif kind == "spherical":
            block = _quaternion_rates(x)
        else:
            R = quaternion_matrix(unpack(x[3:]))
            turn = ca.vertcat(*[ca.horzcat(*row) for row in R])
            block = ca.diagcat(turn, _quaternion_rates(x[3:]))
        assert block.shape[1] == NV[kind]
        E[at.start : at.stop, to.start : to.stop] = block
    return E


def _quaternion_rates(x: ca.SX) -> ca.SX:
    """Give d(x, y, z, w) over a body rotation, shape (4, 3)."""
    a, b, c, w = x[0], x[1], x[2], x[3]
    return 0.5 * ca.vertcat(
        ca.horzcat(w, -c, b), ca.horzcat(c, w, -a), ca.horzcat(-b, a, w), ca.horzcat(-a, -b, -c)
    )
