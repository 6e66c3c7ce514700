"""Derivatives of both dynamic models, exact to rounding: local derivatives of each module, joined in C.

Derivatives over positions are taken in the tangent space: each column of "q" belongs to a freedom of v, also
for cosine-sine pairs and quaternions. The differentiated formulas hold where the loops are closed. Along
motions that keep the loops closed (q, v and a changing consistently) the derivatives are those of the models.
Single columns also depend on the choice of eliminated closure rows.
"""

from __future__ import annotations

from functools import partial

from numpy.typing import ArrayLike

from ..effects.choice import Choice, choose
from ..errors import CompileError
from ..structure.robot import HybridRobot
from .failures import WITHOUT_CASADI, as_compile_error

try:
    from .programs.derivatives.evaluation import Derivatives, Jacobians
    from .programs.sources import kept, robot_key
except ModuleNotFoundError as error:
    raise CompileError(WITHOUT_CASADI) from error

__all__ = ["Derivatives", "ddm_jacobian", "idm_jacobian", "prepared"]

#: Number of prepared derivatives that are kept.
KEPT = 4


def idm_jacobian(
    robot: HybridRobot,
    q: ArrayLike,
    v: ArrayLike,
    a: ArrayLike,
    *,
    effects: Choice = None,
    coordinates: str = "joints",
) -> Jacobians:
    """Compute the derivatives of motor efforts.

    Args:
        robot: The robot.
        q: Positions, shape (nq,) or (T, nq).
        v: Rates, shape (nv,) or (T, nv), [m/s, rad/s].
        a: Accelerations, shape (nv,) or (T, nv), [m/s^2, rad/s^2].
        effects: Effects to include, as for `hybridyn.idm`.
        coordinates: "joints", or "motors": all joints then follow the motors, so that the loops stay closed.

    Returns:
        "q", "v", "a": derivatives of tau over the freedoms of q, over v and over a, shapes
        ([T,] motors, nv), or over positions, rates and accelerations of the motors, shapes
        ([T,] motors, motors). Those over inertial parameters are `hybridyn.regressor`.

    Raises:
        ModelError: An effect is not available in compiled models, or has no derivative.
        CompileError: The derivatives cannot be generated or built.
        HybridynError: As `Derivatives` raises for the samples.

    Example:
        >>> robot = hybridyn.load("five_bar")
        >>> q, v, a = hybridyn.assemble(robot, motors=([0.1, 0.2], [1.0, 0.0], [0.0, 0.0]))
        >>> found = hybridyn.idm_jacobian(robot, q, v, a, coordinates="motors")
        >>> found["a"].round(3)  # the mass matrix
        array([[0.081, 0.021],
               [0.021, 0.07 ]])
    """
    return prepared(robot, "idm", effects, coordinates)(q, v, a)


def ddm_jacobian(
    robot: HybridRobot,
    q: ArrayLike,
    v: ArrayLike,
    tau: ArrayLike,
    *,
    effects: Choice = None,
    coordinates: str = "joints",
) -> Jacobians:
    """Compute the derivatives of accelerations.

    Args:
        robot: The robot.
        q: Positions, shape (nq,) or (T, nq).
        v: Rates, shape (nv,) or (T, nv), [m/s, rad/s].
        tau: Motor efforts, shape (motors,) or (T, motors), [N or N m].
        effects: Effects to include, as for `hybridyn.ddm`.
        coordinates: "joints", or "motors": all joints then follow the motors, so that the loops stay closed.

    Returns:
        "q", "v": derivatives of a over the freedoms of q and over v, shape (nv, nv) or (T, nv, nv); "tau":
        derivatives over the efforts, shape ([T,] nv, motors). With motors as coordinates: derivatives of the
        motors' accelerations over positions and rates of the motors and over the efforts, each of shape
        ([T,] motors, motors).

    Raises:
        ModelError: An effect is not available in compiled models, or has no derivative.
        CompileError: The derivatives cannot be generated or built.
        HybridynError: As `Derivatives` raises for the samples.

    Example:
        >>> robot = hybridyn.load("five_bar")
        >>> q, v, a = hybridyn.assemble(robot, motors=([0.1, 0.2], [1.0, 0.0], [0.0, 0.0]))
        >>> found = hybridyn.ddm_jacobian(robot, q, v, tau=[1.0, -1.0], coordinates="motors")
        >>> sorted(found), found["q"].shape
        (['q', 'tau', 'v'], (2, 2))
    """
    return prepared(robot, "ddm", effects, coordinates)(q, v, tau)


def prepared(
    robot: HybridRobot,
    model: str,
    effects: Choice = None,
    coordinates: str = "joints",
) -> Derivatives:
    """Return the derivatives of a model, which are kept for the last `KEPT` robots and models.

    Args:
        model: "idm" or "ddm".
        effects: Effects to include, as for `hybridyn.idm`.
        coordinates: "joints" or "motors", as for `idm_jacobian`.

    Raises:
        ModelError: As `Derivatives`.
        SingularityError: As `Derivatives`.
        CompileError: As `Derivatives`.
    """
    asked = model, str(coordinates)
    latest = _latest.get(asked) if effects is None else None
    if latest and latest.robot is robot:
        return latest
    with as_compile_error(robot):
        on = choose(robot, effects)
        key = *asked, robot_key(robot, on)
    make = partial(Derivatives, robot, model, on, coordinates=coordinates)
    found = kept(_prepared, key, make, KEPT)
    if effects is None:
        _latest[asked] = found
    return found


_prepared: dict[tuple[str, str, str], Derivatives] = {}
#: The last derivatives of each model with default effects: found without hashing the robot's description.
_latest: dict[tuple[str, str], Derivatives] = {}
