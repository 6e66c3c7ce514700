"""The Jacobian of any link over the independent coordinates: one walk from its module to the root.

    V_link = X_link (J_k Psi_k u_k + X_k V_base),    V_base = a_o u_j + X_o V_base of the module below, ...

Linear in the modules on the way.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from ...spatial import Array, motion_matrix, rotation_from_quaternion, to_body_axes
from ...structure.module import ModuleState
from ...structure.robot import HybridRobot
from ...structure.samples import as_positions, one_of
from ..link_motion import named_links
from .coordinates import Coordinates, independent_coordinates
from .independent import ModuleMotions, independent_motions
from .mass_matrix import output_maps
from .states import closed_states


def link_jacobian(
    robot: HybridRobot, q: ArrayLike, link: str, *, joints: Sequence[str] | None = None, axes: str = "world"
) -> Array:
    """Compute the Jacobian J of a link or platform: its twist is J u, plus that due to a moving base.

    Args:
        robot: The robot.
        q: Positions of the spanning tree, shape (nq,) or (T, nq).
        link: Name of the link. It may also be a massless link inside a wrist.
        joints: Independent joints u, in each module as many as its degrees of freedom; the motors by default.
            The twist of a floating base comes first in u.
        axes: "world": velocity of the link's origin and angular velocity in world axes, as in `kinematics`;
            "link": the same in the link's own axes.

    Returns:
        Shape (6, N) or (T, 6, N).

    Raises:
        AssemblyError: The posture does not close the loops.
        SingularityError: Closures lose rank, or the joints are not independent.
        TrajectoryError: A link is unknown, an array has the wrong shape or is not finite, or a joint cannot
            be a coordinate.
    """
    u = independent_coordinates(robot, joints)
    named_links(robot, [link])
    one_of("axes", axes, "world", "link")
    q, single = as_positions(robot, q)
    states = closed_states(robot, q)
    J, R = _walk(robot, states, independent_motions(states, q, None, u), u, link, len(q))
    if axes == "world":
        if robot.base == "moving":
            R = np.matmul(rotation_from_quaternion(q[:, 3:7]), R)
        J = np.concatenate([np.matmul(R, J[:, :3]), np.matmul(R, J[:, 3:])], axis=1)
    return J[0] if single else J


def _walk(
    robot: HybridRobot,
    states: list[ModuleState],
    motions: list[ModuleMotions],
    u: Coordinates,
    link: str,
    T: int,
) -> tuple[Array, Array]:
    """Compute a link's Jacobian in its own axes, (T, 6, N), and its axes in those of the first base."""
    body, R_link, p_link = robot.bodies.place[link]
    k, number = robot.body_owner[body]
    J, R = np.zeros((T, 6, u.size)), np.tile(R_link, (T, 1, 1))
    X = np.tile(motion_matrix(R_link, p_link), (T, 1, 1))
    if k < 0:
        return J, R
    s = states[k]
    J[:, :, u.own[k]] = np.matmul(X, _relative(s, motions[k], number))
    at = s.spanning.R[:, number], s.spanning.p[:, number]
    while True:
        X, R = np.matmul(X, motion_matrix(*at)), np.matmul(at[0], R)
        k, o = s.module.parent, s.module.parent_output
        if k < 0:
            return J, R
        s = states[k]
        J[:, :, u.own[k]] = np.matmul(X, output_maps(s, motions[k])[o][0])
        at = s.placement(o)


def _relative(s: ModuleState, motions: ModuleMotions, body: int) -> Array:
    """Compute the twist of a body relative to its module's base, in its own axes, over u_k, (T, 6, m)."""
    m = s.mechanism
    if body in m.spec.tree_body:
        out: Array = np.matmul(m.jacobian(s.motion, m.spec.tree_body.index(body)), motions.basis.Psi)
        return out
    J = to_body_axes(s.spanning.R[:, body], m.spanning.jacobian(s.spanning, body))
    of_wrist: Array = np.matmul(J, motions.E)
    return of_wrist
