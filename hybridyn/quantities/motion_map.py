"""The motion map E = dq/du: the rates of every joint over the independent coordinates, and its rate."""

from __future__ import annotations

from collections.abc import Sequence
from typing import overload

import numpy as np
from numpy.typing import ArrayLike

from ..dynamics.forward import forward
from ..dynamics.state_checks import check_closed
from ..errors import SingularityError
from ..linkage.joints import NV
from ..spatial import Array, crm
from ..structure.robot import HybridRobot
from ..structure.samples import as_batch, as_positions, same_samples
from .coordinates import Coordinates, independent_coordinates
from .independent import ModuleMotions, independent_motions


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
    """Compute E(q) with v = E u, and with rates v also E_dot with a = E u_dot + E_dot u.

    u are the rates of the motors, or of `joints`, in this order; a floating base's twist comes first. The
    rows of a prescribed base ("moving") are zero: its twist adds to v.

    Args:
        robot: The robot.
        q: Positions of the spanning tree, shape (nq,) or (T, nq).
        v: Rates, shape (nv,) or (T, nv), [m/s, rad/s].
        joints: Independent joints, as many in each module as it has freedoms; the motors where left out.

    Returns:
        E, shape (nv, N) or (T, nv, N); with `v` also E_dot, of the same shape.

    Raises:
        AssemblyError: The state does not close the loops.
        SingularityError: Closures lose rank, or the joints are not independent: u does not determine v, or
            has more entries than the robot has freedoms.
        TrajectoryError: Arrays of the wrong shape, or not finite; a joint that cannot be a coordinate.
    """
    u = independent_coordinates(robot, joints)
    q, single = as_positions(robot, q)
    rates = np.zeros((len(q), robot.nv)) if v is None else as_batch(v, robot.nv, "v")[0]
    same_samples(q=q, v=rates)
    states = forward(robot, q, rates, None, None)
    check_closed(robot, states, q, rates)
    motions = independent_motions(states, q, None, u)
    E = whole_map(robot, motions, u)
    if v is None:
        return E[0] if single else E
    E_dot = _rate(robot, q, rates, E, u)
    return (E[0], E_dot[0]) if single else (E, E_dot)


def whole_map(robot: HybridRobot, motions: list[ModuleMotions], u: Coordinates) -> Array:
    """Return dq/du of the whole robot from its modules' blocks, shape (T, nv, N)."""
    out = np.zeros((len(motions[0].E) if motions else 0, robot.nv, u.size))
    for module, own, found in zip(robot.modules, u.own, motions, strict=True):
        out[:, module.v_index[:, None], own] = found.E
    return out


def drift(robot: HybridRobot, q: Array, v: Array, u: Coordinates) -> Array:
    """Compute E_dot u: the accelerations of the spanning tree at u_dot = 0, shape (T, nv).

    Args:
        robot: The robot.
        q: Positions, shape (T, nq).
        v: Rates, shape (T, nv).
        u: The independent coordinates.
    """
    out = np.zeros_like(v)
    motions = independent_motions(forward(robot, q, v, None, None), q, v, u)
    for module, found in zip(robot.modules, motions, strict=True):
        out[:, module.v_index] = found.E_drift
    return out


def directions(robot: HybridRobot, v: Array, E: Array) -> tuple[Array, Array]:
    """Return columns of dq/du scaled to the size of the rates, for differences of quadratic forms.

    Args:
        robot: The robot.
        v: Rates, shape (T, nv).
        E: Columns of dq/du, shape (T, nv, k).

    Returns:
        The scaled columns, shape (T, nv, k), and their factors, shape (T, k); factors are one at rest.
    """
    speed = np.abs(v / robot.unit).max(axis=1, initial=0.0)[:, None]
    size = np.abs(E / robot.unit[:, None]).max(axis=1, initial=0.0)
    factor = np.where((speed > 0) & (size > 0), speed / np.where(size > 0, size, 1.0), 1.0)
    return E * factor[:, None], factor


def refuse_idle(robot: HybridRobot, u: Coordinates, what: str) -> None:
    """Refuse coordinates that leave idle motions open: their least-norm rates integrate to no position.

    Raises:
        SingularityError: Naming the module.
    """
    for module, own in zip(robot.modules, u.own, strict=True):
        if len(own) < module.mobility:
            raise SingularityError(
                f"module '{module.name}': {len(own)} {u.words} for {module.mobility} freedoms leave idle "
                f"motions open, and {what} is not defined. Choose {module.mobility} independent joints with "
                "joints=[...]",
                module=module.name,
                what="independent coordinates",
                condition=np.inf,
            )


def _rate(robot: HybridRobot, q: Array, v: Array, E: Array, u: Coordinates) -> Array:
    """Compute E_dot by polarisation of the drift E_dot(v) u, which is quadratic in v, shape (T, nv, N).

    The columns of u are derivatives of one posture by coordinates, so that d(E_j)/du_i and d(E_i)/du_j agree
    on joints with one freedom; on the others, whose rates are twists, they differ by the Lie bracket. Modules
    do not depend on each other: the columns of equal number of all modules are computed at once.
    """
    refuse_idle(robot, u, "the rate of dq/du")
    T, most = len(q), max((len(own) for own in u.own), default=0)
    out = np.zeros_like(E)
    scaled, factor = directions(robot, v, E)
    brackets = _brackets(robot, v, E)
    for j in range(most):
        step = np.zeros_like(v)
        columns = [
            (module.v_index, own[j]) for module, own in zip(robot.modules, u.own, strict=True) if len(own) > j
        ]
        for index, i in columns:
            step[:, index] = scaled[:, index, i]
        both = drift(robot, np.tile(q, (2, 1)), np.concatenate([v + step, v - step]), u)
        for index, i in columns:
            half = (both[:T, index] - both[T:, index]) / (4 * factor[:, None, i])
            out[:, index, i] = half - brackets[:, index, i] / 2
    return out


def _brackets(robot: HybridRobot, v: Array, E: Array) -> Array:
    """Compute the Lie brackets of the rates with the columns of E, joint by joint, shape (T, nv, N)."""
    out = np.zeros_like(E)
    for i, (kind, at) in enumerate(zip(robot.kinds, robot.v_slices, strict=True)):
        if NV[kind] == 1 or (i == 0 and robot.base != "fixed"):
            continue
        S = {"spherical": [3, 4, 5], "planar": [0, 1, 5], "floating": list(range(6))}[kind]
        V, U = np.zeros((len(v), 1, 6)), np.zeros((len(v), E.shape[2], 6))
        V[..., 0, S] = v[:, at]
        U[..., S] = np.swapaxes(E[:, at], 1, 2)
        out[:, at] = np.swapaxes(crm(np.broadcast_to(V, U.shape), U)[..., S], 1, 2)
    return out
