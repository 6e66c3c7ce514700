"""Derivatives of both dynamic models, exact to rounding, by CasADi's automatic differentiation.

Derivatives over positions are taken in the tangent space: each column of "q" belongs to a freedom of v, also
for cosine-sine pairs and quaternions. The differentiated formulas hold where the loops are closed. Along
motions that keep the loops closed (q, v and a changing consistently) the derivatives are those of the models.
Single columns also depend on the choice of eliminated closure rows.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..effects.choice import Choice, choose
from ..errors import CompileError, ModelError, SingularityError, TrajectoryError
from ..linkage.joints import NV
from ..spatial import Array
from ..structure.leg_model import pinocchio_inertia
from ..structure.robot import HybridRobot
from ..structure.samples import as_batch, same_samples
from .code.scalars import GUARD_LIMIT
from .failures import as_compile_error
from .needs import WITHOUT_CASADI
from .programs.general import GENERAL, general

try:
    import casadi as ca

    from .equations.expressions import unpack
    from .equations.rigid import quaternion_matrix
    from .programs.interpreter import function_of
    from .programs.sources import robot_key
    from .programs.whole_robot import programs
except ModuleNotFoundError as error:
    raise CompileError(WITHOUT_CASADI) from error

Jacobians = dict[str, Array]


#: Number of prepared derivatives that are kept: those of the LX4 take some hundred megabytes.
KEPT = 4
#: Largest allowed difference from the general path of a model whose guard is above its limit, relative to the
#: largest entry.
DERIVATIVE_AGREES = 1e-6


def idm_jacobian(
    robot: HybridRobot, q: ArrayLike, v: ArrayLike, a: ArrayLike, *, effects: Choice = None
) -> Jacobians:
    """Compute the derivatives of motor efforts.

    Args:
        robot: The robot.
        q: Positions, shape (nq,) or (T, nq).
        v: Rates, shape (nv,) or (T, nv), [m/s, rad/s].
        a: Accelerations, shape (nv,) or (T, nv), [m/s^2, rad/s^2].
        effects: Effects to include, as for `hybridyn.idm`.

    Returns:
        "q", "v", "a": derivatives of tau over the freedoms of q, over v and over a, shapes
        ([T,] motors, nv); "parameters": derivatives over the ten inertial parameters of each body of
        `robot.bodies`, shape (motors, 10 bodies).

    Raises:
        ModelError: An effect is not available in compiled models, or has no derivative.
        HybridynError: As `Derivatives` raises for the samples.
    """
    return prepared(robot, "idm", effects)(q, v, a)


def ddm_jacobian(
    robot: HybridRobot, q: ArrayLike, v: ArrayLike, tau: ArrayLike, *, effects: Choice = None
) -> Jacobians:
    """Compute the derivatives of accelerations.

    Args:
        robot: The robot.
        q: Positions, shape (nq,) or (T, nq).
        v: Rates, shape (nv,) or (T, nv), [m/s, rad/s].
        tau: Motor efforts, shape (motors,) or (T, motors), [N or N m].
        effects: Effects to include, as for `hybridyn.ddm`.

    Returns:
        "q", "v": derivatives of a over the freedoms of q and over v, shape (nv, nv) or (T, nv, nv); "tau":
        derivatives over the efforts, shape (nv, motors); "parameters": derivatives over the ten inertial
        parameters of each body of `robot.bodies`, shape (nv, 10 bodies).

    Raises:
        ModelError: An effect is not available in compiled models, or has no derivative.
        HybridynError: As `Derivatives` raises for the samples.
    """
    return prepared(robot, "ddm", effects)(q, v, tau)


def prepared(robot: HybridRobot, model: str, effects: Choice = None) -> Derivatives:
    """Return the derivatives of a model, which are kept for the last `KEPT` robots and models.

    Args:
        robot: The robot.
        model: "idm" or "ddm".
        effects: Effects to include, as for `hybridyn.idm`.

    Raises:
        ModelError: As `Derivatives`.
    """
    robot.check_model()
    with as_compile_error(robot):
        key = model, robot_key(robot, choose(robot, effects))
    found = _prepared.pop(key, None) or Derivatives(robot, model, effects)
    _prepared[key] = found
    if len(_prepared) > KEPT:
        del _prepared[next(iter(_prepared))]
    return found


class Derivatives:
    """The derivatives of one model of one robot, prepared once and evaluated often."""

    def __init__(self, robot: HybridRobot, model: str, effects: Choice = None) -> None:
        """Generate the model and differentiate it.

        Args:
            robot: The robot.
            model: "idm" or "ddm".
            effects: Effects to include, as for `hybridyn.idm`.

        Raises:
            ModelError: `model` is unknown, or an effect is not available in compiled models or has no
                derivative.
        """
        if model not in GENERAL:
            raise ModelError(f"there are derivatives of 'idm' and 'ddm', not of '{model}'")
        self._effects = choose(robot, effects)
        if self._effects.limits is not None:
            raise ModelError(
                "the effect 'limits' has no derivative: clip the efforts before the call", element="limits"
            )
        self._robot, self._model = robot, model
        with as_compile_error(robot):
            program = programs(robot, self._effects, models=(model,), parameters=True)[model]
        self._value = function_of(program)
        self._sizes = dict(program.inputs)
        columns = [ca.SX.sym(name, size) for name, size in program.inputs]
        out, guard = self._value.call(columns)
        blocks = []
        for name, column in zip(self._sizes, columns, strict=True):
            J = ca.jacobian(out, column)
            blocks.append(J @ _tangent(robot, column) if name == "q" else J)
        self._jacobian = ca.Function(
            f"{model}_jacobian", columns, [*blocks, guard], list(self._sizes),
            [*(f"d_{name}" for name in self._sizes), "guard"],
        )  # fmt: skip
        self._parameters = np.concatenate(
            [pinocchio_inertia(body).toDynamicParameters() for body in robot.bodies.bodies]
        )

    @property
    def casadi(self) -> ca.Function:
        """The derivatives as a CasADi function with named inputs and outputs, and "guard" last."""
        return self._jacobian

    def __call__(self, *given: ArrayLike) -> Jacobians:
        """Evaluate at one sample or many.

        Args:
            given: The model's arguments, shapes (n,) or (T, n). The acceleration of a "moving" base is
                optional and defaults to zero.

        Raises:
            TrajectoryError: An array is missing, has a wrong shape, or has a number that is not finite.
            HybridynError: The loops are open or rank is lost at a state (errors of the general path).
            SingularityError: The pivots of the elimination vanish at a state, so digits are lost.
        """
        wanted = {name: size for name, size in self._sizes.items() if name != "parameters"}
        if len(given) == 3 and "base_acceleration" in wanted:
            given = (*given, np.zeros((*np.shape(given[0])[:-1], 6)))
        if len(given) != len(wanted):
            raise TrajectoryError(f"expected the arrays {', '.join(wanted)}; {len(given)} were given")
        pairs = zip(given, wanted.items(), strict=True)
        checked = {name: as_batch(array, size, name) for array, (name, size) in pairs}
        arrays = {name: array for name, (array, _) in checked.items()}
        same_samples(**arrays)
        samples = len(arrays["q"])
        shapes = [self._jacobian.size_out(i) for i in range(len(self._sizes))]
        blocks = [np.empty((samples, *shape)) for shape in shapes]
        guard = np.empty(samples)
        for t in range(samples):
            *J, worst = self._jacobian.call([*(x[t] for x in arrays.values()), self._parameters])
            guard[t] = float(worst)
            for block, value in zip(blocks, J, strict=True):
                block[t] = value
        doubtful = np.flatnonzero(~(guard <= GUARD_LIMIT))
        if len(doubtful):
            self._check_doubtful(arrays, doubtful.tolist())
        out = dict(zip(self._sizes, blocks, strict=True))
        return {name: block[0] for name, block in out.items()} if checked["q"][1] else out

    def _check_doubtful(self, arrays: dict[str, Array], doubtful: list[int]) -> None:
        """Compare samples whose guard is above its limit with the general path.

        Raises:
            HybridynError: The general path cannot compute them either, or the model differs from it there.
        """
        wanted = general(self._robot, self._effects, self._model, arrays)
        for t in doubtful:
            value = self._value.call([*(x[t] for x in arrays.values()), self._parameters])[0]
            off = np.abs(np.array(value).ravel() - wanted[t]).max() / np.abs(wanted[t]).max(initial=1e-300)
            if not off <= DERIVATIVE_AGREES:
                raise SingularityError(
                    f"derivatives of '{self._model}' are not to be trusted at sample {t}: the pivots of the "
                    f"compiled model vanish there, and it differs from the general path by {off:.2g} of the "
                    f"largest entry (limit {DERIVATIVE_AGREES:g}). Move away from that posture",
                    sample=t,
                )


_prepared: dict[tuple[str, str], Derivatives] = {}


def _tangent(robot: HybridRobot, q: ca.SX) -> ca.SX:
    """Return the derivative of the coordinates q over the freedoms, shape (nq, nv)."""
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
    """Return the derivative of a quaternion (x, y, z, w) over a rotation in the body frame, shape (4, 3)."""
    a, b, c, w = x[0], x[1], x[2], x[3]
    return 0.5 * ca.vertcat(
        ca.horzcat(w, -c, b), ca.horzcat(c, w, -a), ca.horzcat(-b, a, w), ca.horzcat(-a, -b, -c)
    )
