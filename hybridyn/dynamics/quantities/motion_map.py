"""The motion map E = dq/du: the rates of every joint over the independent coordinates, and its rate."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import overload

import numpy as np
from numpy.typing import ArrayLike

from ...description.names import counted
from ...errors import SingularityError
from ...linkage.joints import NV
from ...spatial import Array, Index, crm
from ...structure.robot import HybridRobot
from ..forward import forward
from .coordinates import Coordinates, independent_coordinates
from .independent import ModuleMotions, independent_motions
from .polar import polar_form
from .states import checked_state, closed_states

#: Accelerations at u_dot = 0 as a function of positions and rates.
Drift = Callable[[Array, Array], Array]


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
    """
    u = independent_coordinates(robot, joints)
    q, rates, single = checked_state(robot, q, v)
    motions = independent_motions(closed_states(robot, q, rates), q, None, u)
    E = whole_map(robot, motions, u, len(q))
    if v is None:
        return E[0] if single else E
    E_dot = rate_of_map(robot, q, rates, E, u, lambda x, y: drift(robot, x, y, u))
    return (E[0], E_dot[0]) if single else (E, E_dot)


def whole_map(robot: HybridRobot, motions: list[ModuleMotions], u: Coordinates, samples: int) -> Array:
    """Return dq/du of the whole robot from its modules' blocks, shape (samples, nv, N)."""
    out = np.zeros((samples, robot.nv, u.size))
    for module, own, found in zip(robot.modules, u.own, motions, strict=True):
        out[:, module.v_index[:, None], own] = found.E
    return out


def drift(robot: HybridRobot, q: Array, v: Array, u: Coordinates) -> Array:
    """Compute E_dot u: the accelerations of the spanning tree at u_dot = 0, shape (T, nv).

    Args:
        q: Positions, shape (T, nq).
        v: Rates, shape (T, nv).
    """
    motions = independent_motions(forward(robot, q, v, None, None), q, v, u)
    return whole_drift(robot, motions, len(q))


def whole_drift(robot: HybridRobot, motions: list[ModuleMotions], samples: int) -> Array:
    """Return the drift of the whole robot from its modules' parts, shape (samples, nv)."""
    out = np.zeros((samples, robot.nv))
    for module, found in zip(robot.modules, motions, strict=True):
        out[:, module.v_index] = found.E_drift
    return out


def refuse_idle(robot: HybridRobot, u: Coordinates, what: str) -> None:
    """Refuse coordinates that leave idle motions open: their least-norm rates integrate to no position.

    Raises:
        SingularityError: Naming the module.
    """
    for module, own in zip(robot.modules, u.own, strict=True):
        if len(own) < module.mobility:
            raise SingularityError(
                f"module '{module.name}': {len(own)} {u.words} for "
                f"{counted(module.mobility, 'freedom')} leave idle motions open, and {what} is not defined. "
                f"{u.mend}, {module.mobility} in this module",
                module=module.name,
                what="independent coordinates",
                condition=np.inf,
            )


def rate_of_map(
    robot: HybridRobot,
    q: Array,
    v: Array,
    E: Array,
    u: Coordinates,
    drift_of: Callable[[Array, Array], Array],
) -> Array:
    """Compute E_dot by polarisation of the drift E_dot(v) u, which is quadratic in v, shape (T, nv, N).

    The columns of u are derivatives of one posture by coordinates, so that d(E_j)/du_i and d(E_i)/du_j agree
    on joints with one freedom; on the others, whose rates are twists, they differ by the Lie bracket. Modules
    do not depend on each other: the columns of equal number of all modules are computed at once.

    Args:
        q: Positions, shape (T, nq).
        v: Rates, shape (T, nv).
        E: dq/du, shape (T, nv, N).
        drift_of: The drift at positions (S, nq) and rates (S, nv), shape (S, nv).
    """
    refuse_idle(robot, u, "the rate of dq/du")
    if not u.size:
        return np.zeros_like(E)
    places = blocks(robot, u)
    together = np.zeros((len(q), robot.nv, max(len(own) for _, own, _ in places)))
    for index, own, at in places:
        together[:, index, at] = E[:, index, own]
    form = polar_form(robot, drift_of, q, v, together)
    out = -_brackets(robot, v, E) / 2
    for index, own, at in places:
        out[:, index, own] += form[:, index, at]
    return out


def blocks(robot: HybridRobot, u: Coordinates) -> list[tuple[Index, Index, Index]]:
    """Return where the blocks of dq/du are: of each module its rows, its columns, and their numbers in it."""
    return [
        (module.v_index[:, None], own, np.arange(len(own)))
        for module, own in zip(robot.modules, u.own, strict=True)
    ]


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
