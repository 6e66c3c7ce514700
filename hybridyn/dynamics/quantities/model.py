"""The closed-loop model tau = M u_dot + c + g, v = E u: what controllers and optimisers ask of it."""

from collections.abc import Sequence
from typing import overload

import numpy as np
from numpy.typing import ArrayLike

from ...effects.choice import Choice, choose, times, without_losses
from ...errors import TrajectoryError
from ...spatial import Array, crm
from ...structure.robot import HybridRobot
from ...structure.samples import as_positions
from ..direct import acceleration_of_base, needs_inertia
from ..state_checks import checked_state
from .engine import Engine, GeneralEngine, chosen_effects
from .independent import independent_coordinates
from .polar_forms import polar_form, rate_of_map

#: Effects that g is made of.
WEIGHTS = ("gravity", "inertia", "leg_inertia")


@overload
def motion_map(
    robot: HybridRobot, q: ArrayLike, v: None = None, *, joints: Sequence[str] | None = None
) -> Array: ...
@overload
def motion_map(
    robot: HybridRobot, q: ArrayLike, v: ArrayLike, *, joints: Sequence[str] | None = None
) -> tuple[Array, Array]: ...
def motion_map(
    robot: HybridRobot, q: ArrayLike, v: ArrayLike | None = None, *, joints: Sequence[str] | None = None
) -> Array | tuple[Array, Array]:
    """Compute the map E(q) from independent rates u to all rates v = E u, and also E_dot if `v` is given.

    Accelerations are a = E u_dot + E_dot u. The entries of u are the rates of the motors, or of `joints`, in
    this order; the twist of a floating base comes first. The rows of a prescribed base ("moving") are zero,
    because its twist is added to v.

    Args:
        robot: The robot.
        q: Positions of the spanning tree, shape (nq,) or (T, nq).
        v: Rates, shape (nv,) or (T, nv), [m/s, rad/s].
        joints: Independent joints, in each module as many as its degrees of freedom; the motors by default.

    Returns:
        E, shape (nv, N) or (T, nv, N); with `v` also E_dot, of the same shape.

    Raises:
        AssemblyError: The state does not close the loops.
        SingularityError: Closures lose rank, or the joints are not independent: u does not determine v, or
            has more entries than the robot has freedoms.
        TrajectoryError: An array has the wrong shape or is not finite, or a joint cannot be a coordinate.

    Example:
        >>> robot = hybridyn.load("five_bar")
        >>> q, v, a = hybridyn.assemble(robot, motors=([0.1, 0.2], [1.0, 0.0], [0.0, 0.0]))
        >>> E = hybridyn.motion_map(robot, q)
        >>> bool(abs(E @ v[robot.motor_v] - v).max() < 1e-12)
        True
    """
    engine = GeneralEngine.of(robot, joints)
    q, rates, single = checked_state(robot, q, v)
    E = engine.basis(q, None if v is None else rates)
    if v is None:
        return E[0] if single else E
    E_dot = rate_of_map(engine, q, rates, E)
    return (E[0], E_dot[0]) if single else (E, E_dot)


def mass_matrix(
    robot: HybridRobot, q: ArrayLike, *, joints: Sequence[str] | None = None, effects: Choice = None
) -> Array:
    """Compute the mass matrix M(q) of tau = M u_dot + c + g; the kinetic energy is u^T M u / 2.

    Each module adds a block over its own coordinates and those of the modules below it. For a chain this
    arithmetic grows with the cube of the number of modules; below fifty modules, other work takes longer.

    Args:
        robot: The robot.
        q: Positions of the spanning tree, shape (nq,) or (T, nq).
        joints: Independent joints u, in each module as many as its degrees of freedom; the motors by default.
            The twist of a floating base comes first in u.
        effects: As in `idm`; rotors contribute if "rotor_inertia" is among these effects.

    Returns:
        Symmetric matrix, shape (N, N) or (T, N, N), [kg, kg m, kg m^2].

    Raises:
        AssemblyError: The posture does not close the loops.
        SingularityError: Closures lose rank, or the joints are not independent.
        ModelError: Effects are unknown, lack parameters, or do not include "inertia".
        TrajectoryError: An array has the wrong shape or is not finite, or a joint cannot be a coordinate.

    Example:
        >>> robot = hybridyn.load("five_bar")
        >>> hybridyn.mass_matrix(robot, robot.home).round(4)
        array([[0.0778, 0.0191],
               [0.0191, 0.0779]])
    """
    u = independent_coordinates(robot, joints)
    on = without_losses(choose(robot, effects).unbounded, "the mass matrix does not take")
    needs_inertia(on)
    q, single = as_positions(robot, q)
    M = GeneralEngine(robot, u, on).mass(q)
    return M[0] if single else M


def bias(
    robot: HybridRobot,
    q: ArrayLike,
    v: ArrayLike | None,
    *,
    joints: Sequence[str] | None = None,
    effects: Choice = None,
    time: ArrayLike | None = None,
    base_acceleration: ArrayLike | None = None,
) -> Array:
    """Compute c(q, v) + g(q) of tau = M u_dot + c + g: the generalised force along u at u_dot = 0.

    Args:
        robot: The robot.
        q: Positions of the spanning tree, shape (nq,) or (T, nq).
        v: Rates, shape (nv,) or (T, nv), [m/s, rad/s]; zero if None.
        joints: Independent joints u, in each module as many as its degrees of freedom; the motors by default.
            The twist of a floating base comes first in u.
        effects: As in `idm`; friction, springs and contacts contribute if they are among these effects.
        time: Time of each sample, shape () or (T,), [s], for effects that follow a table.
        base_acceleration: Spatial acceleration of a "moving" base in its own frame, shape (6,) or (T, 6);
            zero by default.

    Returns:
        Shape (N,) or (T, N), [N or N m].

    Raises:
        AssemblyError: The state does not close the loops.
        SingularityError: Closures lose rank, or the joints are not independent.
        ModelError: Effects are unknown, lack parameters, or prescribe the base.
        TrajectoryError: An array has the wrong shape or is not finite, or a joint cannot be a coordinate.

    Example:
        >>> robot = hybridyn.load("five_bar")
        >>> q, v, a = hybridyn.assemble(robot, motors=([0.1, 0.2], [1.0, 0.0], [0.0, 0.0]))
        >>> hybridyn.bias(robot, q, v).round(3)
        array([ 2.128, -1.31 ])
    """
    engine = GeneralEngine.of(robot, joints, effects)
    q, v, single = checked_state(robot, q, v)
    base = None if base_acceleration is None else acceleration_of_base(robot, base_acceleration, len(q))
    out = engine.bias(q, v, times(time, len(q)), base)
    return out[0] if single else out


def coriolis(
    robot: HybridRobot,
    q: ArrayLike,
    v: ArrayLike,
    *,
    joints: Sequence[str] | None = None,
    effects: Choice = None,
) -> Array:
    """Compute c(q, v): the Coriolis and centrifugal part of `bias`, without weights and joint laws.

    Args:
        robot: The robot.
        q: Positions, shape (nq,) or (T, nq).
        v: Rates, shape (nv,) or (T, nv), [m/s, rad/s].
        joints: As in `bias`.
        effects: As in `bias`; of these, only inertia, legs, rotors and velocity terms contribute.

    Returns:
        Shape (N,) or (T, N), [N or N m].

    Raises:
        AssemblyError, SingularityError, ModelError, TrajectoryError: As `bias`.

    Example:
        >>> robot = hybridyn.load("five_bar")
        >>> q, v, a = hybridyn.assemble(robot, motors=([0.1, 0.2], [1.0, 0.0], [0.0, 0.0]))
        >>> hybridyn.coriolis(robot, q, v).round(3)
        array([ 0.015, -0.02 ])
    """
    engine = GeneralEngine.of(robot, joints, effects)
    q, v, single = checked_state(robot, q, v)
    out = engine.coriolis(q, v)
    return out[0] if single else out


def gravity(
    robot: HybridRobot, q: ArrayLike, *, joints: Sequence[str] | None = None, effects: Choice = None
) -> Array:
    """Compute g(q): the generalised force along u that balances the weights (gradient of their energy).

    Args:
        robot: The robot.
        q: Positions, shape (nq,) or (T, nq).
        joints: As in `bias`.
        effects: As in `bias`; of these, only the weights of bodies and legs contribute.

    Returns:
        Shape (N,) or (T, N), [N or N m].

    Raises:
        AssemblyError, SingularityError, ModelError, TrajectoryError: As `bias`.

    Example:
        >>> robot = hybridyn.load("five_bar")
        >>> hybridyn.gravity(robot, robot.home).round(3)
        array([ 1.875, -1.875])
    """
    return bias(robot, q, None, joints=joints, effects=chosen_effects(robot, effects).only(WEIGHTS))


def coriolis_matrix(
    robot: HybridRobot, q: ArrayLike, v: ArrayLike, *, joints: Sequence[str] | None = None,
    effects: Choice = None,
) -> Array:  # fmt: skip
    """Compute C(q, v) with c = C u and M_dot - 2C skew-symmetric (Christoffel's symbols).

    c(v) is quadratic in the rates, and the symbols are its polar form between v and the columns of E,
    exactly, without differences of postures. The twist of a floating base is no derivative of coordinates:
    half the Lie bracket of its columns, times M, is added. One pass of the bias for each column: quadratic in
    the modules.

    Args:
        robot: The robot; a "moving" base has to be at rest.
        q: Positions of the spanning tree, shape (nq,) or (T, nq).
        v: Rates, shape (nv,) or (T, nv), [m/s, rad/s].
        joints: Independent joints u, in each module as many as its degrees of freedom; the motors by default.
            The twist of a floating base comes first in u.
        effects: As in `coriolis`.

    Returns:
        Shape (N, N) or (T, N, N), [kg/s, kg m/s, kg m^2/s].

    Raises:
        AssemblyError: The state does not close the loops.
        SingularityError: Closures lose rank, or the joints are not independent or leave idle motions open.
        ModelError: Effects are unknown, lack parameters, or prescribe the base.
        TrajectoryError: An array has the wrong shape or is not finite, or a prescribed base moves.

    Example:
        >>> robot = hybridyn.load("five_bar")
        >>> q, v, a = hybridyn.assemble(robot, motors=([0.1, 0.2], [1.0, 0.0], [0.0, 0.0]))
        >>> hybridyn.coriolis_matrix(robot, q, v).round(3)
        array([[ 0.015,  0.001],
               [-0.02 ,  0.007]])
        >>> u = v[robot.motor_v]
        >>> (hybridyn.coriolis_matrix(robot, q, v) @ u).round(3)
        array([ 0.015, -0.02 ])
    """
    engine = GeneralEngine.of(robot, joints, effects)
    q, v, single = checked_state(robot, q, v)
    C = christoffel(engine, q, v)
    return C[0] if single else C


def christoffel(engine: Engine, q: Array, v: Array) -> Array:
    """Compute C(q, v) as `coriolis_matrix` does, by any engine, shape (T, N, N).

    Args:
        q: Positions, shape (T, nq).
        v: Rates, shape (T, nv).

    Raises:
        SingularityError: The coordinates leave idle motions open.
        TrajectoryError: A prescribed base moves.
    """
    robot = engine.robot
    engine.u.fit(robot, "the Coriolis matrix")
    if robot.base == "moving" and v[:, :6].any():
        raise TrajectoryError(
            "coriolis_matrix: the moving base has a twist, and c is not C u then: take coriolis(), or a base "
            "at rest"
        )
    C = polar_form(robot, engine.coriolis, q, v, engine.basis(q))
    if robot.base == "floating":
        C[:, :, :6] += of_brackets(engine.mass(q), v)
    return C


def of_brackets(M: Array, v: Array) -> Array:
    """Compute half the Lie brackets of a floating base's twist with its columns, times M, shape (T, N, 6).

    Args:
        M: Mass matrices, shape (T, N, N).
        v: Rates, shape (T, nv).
    """
    twist = np.broadcast_to(v[:, None, :6], (len(v), 6, 6))
    brackets = np.swapaxes(crm(twist, np.broadcast_to(np.eye(6), twist.shape)), 1, 2)
    out: Array = np.matmul(M[:, :, :6], brackets) / 2
    return out
