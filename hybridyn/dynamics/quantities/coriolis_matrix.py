"""The Coriolis matrix of a closed robot: c = C u, and M_dot - 2C is skew-symmetric.

It is that of Christoffel's symbols. c(v) is quadratic in the rates, and the symbols are its polar form:

    C(v) e_j = (c(v + w) - c(v - w)) / 4,    w = E e_j

exactly, without differences of postures. The twist of a floating base is no derivative of coordinates: half
the Lie bracket of its columns, times M, is added. One pass of the bias for each column: quadratic in the
modules.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from ...effects.choice import Choice
from ...errors import TrajectoryError
from ...spatial import Array, crm
from ...structure.robot import HybridRobot
from ..forward import forward
from .bias import QUADRATIC, chosen_effects, forces_at_rest
from .coordinates import independent_coordinates
from .independent import independent_motions
from .mass_matrix import composite_inertia
from .motion_map import refuse_idle, whole_map
from .polar import polar_form
from .states import checked_state


def coriolis_matrix(
    robot: HybridRobot,
    q: ArrayLike,
    v: ArrayLike,
    *,
    joints: Sequence[str] | None = None,
    effects: Choice = None,
) -> Array:
    """Compute C(q, v) with c = C u and M_dot - 2C skew-symmetric (Christoffel's symbols).

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
    """
    u, on = independent_coordinates(robot, joints), chosen_effects(robot, effects).only(QUADRATIC)
    refuse_idle(robot, u, "the Coriolis matrix")
    q, v, single = checked_state(robot, q, v)
    if robot.base == "moving" and v[:, :6].any():
        raise TrajectoryError(
            "coriolis_matrix: the moving base has a twist, and c is not C u then: take coriolis(), or a base "
            "at rest"
        )
    states = forward(robot, q, np.zeros_like(v), None, None)
    motions = independent_motions(states, q, None, u)
    E = whole_map(robot, motions, u, len(q))
    C = polar_form(robot, lambda x, y: forces_at_rest(robot, x, y, u, on), q, v, E)
    if robot.base == "floating":
        C[:, :, :6] += of_brackets(composite_inertia(robot, states, motions, u, on, len(q)), v)
    return C[0] if single else C


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
