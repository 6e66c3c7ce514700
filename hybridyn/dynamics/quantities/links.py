"""What links are and feel like through the loops: Jacobians J, J M^-1 J^T (Delassus), and its inverse.

J is the Jacobian of the spanning tree times dq/du. The direct model at rest, under unit wrenches and
nothing else, gives the columns of the Delassus matrix, each linear in the modules; M is never formed. All
motions of the robot count, also those that no motor drives.
"""

from collections.abc import Sequence
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from ...effects.choice import Choice, Effects
from ...linkage.motion import Motion
from ...spatial import Array, Index, to_body_axes
from ...structure.robot import HybridRobot
from ...structure.samples import as_positions, one_of
from ..direct import direct_model
from ..guards import FIXED_LINKS, check
from ..link_motion import link_motions, named_links
from .engine import Engine, GeneralEngine, chosen_effects
from .polar_forms import by_columns

#: Effects that inertia is made of.
INERTIAL = ("inertia", "leg_inertia", "rotor_inertia")


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

    Example:
        >>> robot = hybridyn.load("five_bar")
        >>> hybridyn.link_jacobian(robot, robot.home, "m1_tool")[[0, 2]].round(3)  # its x and z
        array([[-0.191, -0.191],
               [ 0.13 , -0.13 ]])
    """
    engine = GeneralEngine.of(robot, joints)
    named_links(robot, [link])
    one_of("axes", axes, "world", "link")
    q, single = as_positions(robot, q)
    J = link_jacobians(engine, q, [link], axes)
    return J[0] if single else J


def link_jacobians(engine: Engine, q: Array, links: Sequence[str], axes: str) -> Array:
    """Compute the Jacobians of k links by any engine, shape (T, 6 k, N).

    The Jacobian of the spanning tree, whose columns come from the poses on the way to the root, times dq/du.

    Args:
        q: Positions, shape (T, nq).
        links: Their names.
        axes: As in `link_jacobian`.
    """
    bodies, E = engine.bodies(q, np.zeros((len(q), engine.robot.nv))), engine.basis(q)
    return np.concatenate([_link_jacobian(engine.robot, bodies, E, link, axes) for link in links], axis=1)


def _link_jacobian(robot: HybridRobot, motion: Motion, E: Array, link: str, axes: str) -> Array:
    """Compute the Jacobian of a link, shape (T, 6, N), from the motion of all bodies."""
    columns, bodies, S = _way_to_root(robot, link)
    body, R, p = robot.bodies.place[link]
    turned = motion.R[:, [*bodies, body]]
    arm = motion.p[:, None, body] + (turned[:, -1] @ p)[:, None] - motion.p[:, bodies]
    w = np.matmul(turned[:, :-1], S[:, 3:, None])[..., 0]
    twists = [np.matmul(turned[:, :-1], S[:, :3, None])[..., 0] + np.cross(w, arm), w]
    if axes == "link":
        twists = [np.matmul(part, turned[:, -1] @ R) for part in twists]
    out: Array = np.matmul(np.swapaxes(np.concatenate(twists, axis=2), 1, 2), E[:, columns])
    return out


def _way_to_root(robot: HybridRobot, link: str) -> tuple[Index, list[int], Array]:
    """Return the freedoms that move a link in the spanning tree.

    Returns:
        Their entries of v, the bodies that they move, and the motion subspace in these bodies' frames, shape
        (k, 6).
    """
    columns, bodies, S = [np.zeros(0, dtype=int)], list[int](), [np.zeros((0, 6))]
    k, number = robot.body_owner[robot.bodies.place[link][0]]
    while k > 0 or (k == 0 and robot.base != "floating"):
        module = robot.modules[k]
        tree = module.mechanism.spanning
        moved = np.flatnonzero(tree.support[number])
        columns.append(module.v_index[moved])
        bodies += [robot.body_of_joint[module.joints[i]] for i in tree.dof_body[moved] - 1]
        S.append(np.concatenate([tree.S_linear, tree.S_angular], axis=1)[moved])
        k, number = robot.body_owner[robot.bodies.place[module.base][0]]
    if robot.base == "floating":
        columns, bodies, S = [*columns, np.arange(6)], [*bodies, *[0] * 6], [*S, np.eye(6)]
    return np.concatenate(columns), bodies, np.concatenate(S)


def delassus(
    robot: HybridRobot, q: ArrayLike, links: str | Sequence[str], *, axes: str = "world",
    effects: Choice = None,
) -> Array:  # fmt: skip
    """Compute J M^-1 J^T of links: their accelerations per unit wrench on them, at rest and without weight.

    Contact solvers call it the Delassus matrix. It exists for any mobility and any number of motors.

    Args:
        robot: The robot; a "moving" base is held.
        q: Positions of the spanning tree, shape (nq,) or (T, nq).
        links: Names of one or several links; the result has six rows for each, in this order.
        axes: Axes of wrenches and accelerations at the links' origins: "world", or "link" for their own.
        effects: As in `idm`; rotors contribute if "rotor_inertia" is among these effects.

    Returns:
        Shape (6 k, 6 k) or (T, 6 k, 6 k), symmetric, positive semidefinite.

    Raises:
        AssemblyError: The posture does not close the loops.
        SingularityError: Closures lose rank, or a wrench acts on a motion without inertia.
        ModelError: Effects are unknown, lack parameters, or do not include "inertia".
        TrajectoryError: A link is unknown, or an array has the wrong shape or is not finite.

    Example:
        >>> robot = hybridyn.load("five_bar")
        >>> q, v, a = hybridyn.assemble(robot, motors=([0.1, 0.2], [1.0, 0.0], [0.0, 0.0]))
        >>> hybridyn.delassus(robot, q, "m1_tool")[[0, 2]][:, [0, 2]].round(3)  # its x and z
        array([[ 0.738, -0.048],
               [-0.048,  0.535]])
    """
    names = [links] if isinstance(links, str) else list(links)
    named_links(robot, names)
    one_of("axes", axes, "world", "link")
    on = chosen_effects(robot, effects).only(INERTIAL)
    q, single = as_positions(robot, q)
    rows = 6 * len(names)
    pushed = partial(_pushed, robot, names, on, axes)
    out = by_columns(pushed, q, np.broadcast_to(np.eye(rows), (len(q), rows, rows)))
    out = (out + np.swapaxes(out, 1, 2)) / 2
    return out[0] if single else out


def _pushed(robot: HybridRobot, names: Sequence[str], on: Effects, axes: str, q: Array, W: Array) -> Array:
    """Compute the accelerations of links from rest under wrenches, shapes (S, 6 k)."""
    rest = np.zeros((len(q), robot.nv))
    placed = link_motions(robot, q, rest, names)
    wrenches = {name: np.zeros((len(q), 6)) for name in names}
    for i, name in enumerate(names):
        own = W[:, 6 * i : 6 * i + 6]
        turned = to_body_axes(placed[name].R, own[..., None])[..., 0] if axes == "world" else own
        wrenches[name] += turned
    still = np.zeros((len(q), len(robot.motors)))
    a = direct_model(robot, q, rest, still, wrenches=wrenches, effects=on).values
    moved = link_motions(robot, q, a, names)
    twists = {k: m.twist() if axes == "link" else np.c_[m.p_dot, m.w] for k, m in moved.items()}
    return np.concatenate([twists[name] for name in names], axis=1)


def operational_inertia(
    robot: HybridRobot,
    q: ArrayLike,
    links: str | Sequence[str],
    *,
    axes: str = "world",
    effects: Choice = None,
) -> Array:
    """Compute the operational-space inertia of links, (J M^-1 J^T)^-1: wrench per acceleration.

    Args:
        robot: The robot.
        q: Positions, shape (nq,) or (T, nq).
        links: As in `delassus`.
        axes: As in `delassus`.
        effects: As in `delassus`.

    Returns:
        Shape (6 k, 6 k) or (T, 6 k, 6 k), symmetric, positive definite.

    Raises:
        SingularityError: The links cannot be moved in every direction (`IMMOVABLE`, scaled by its size).
        AssemblyError, ModelError, TrajectoryError: As `delassus`.

    Example:
        >>> robot = hybridyn.load("gough_stewart")
        >>> hybridyn.operational_inertia(robot, robot.home, "m1_platform").shape
        (6, 6)
    """
    D = delassus(robot, q, links, axes=axes, effects=effects)
    out, size = inverse_of(robot, D.reshape(-1, *D.shape[-2:]))
    words = {"what": "operational inertia", "links": links if isinstance(links, str) else ", ".join(links)}
    largest = np.where(size[:, -1] > 0, size[:, -1], 1.0)
    check(FIXED_LINKS, None, largest, size[:, 0], lambda t: words)
    return out.reshape(D.shape)


def inverse_of(robot: HybridRobot, D: Array) -> tuple[Array, Array]:
    """Compute the inverses of Delassus matrices, shape (T, n, n), from their eigenvalues.

    Returns:
        The inverses, and the eigenvalues, ascending, scaled by the robot's size, shape (T, n).
    """
    unit = np.tile([robot.bodies.size] * 3 + [1.0] * 3, D.shape[1] // 6)
    size, axes = np.linalg.eigh(D / unit[:, None] / unit)
    with np.errstate(divide="ignore", invalid="ignore"):  # of links that cannot be moved
        out = np.matmul(axes / size[:, None], np.swapaxes(axes, 1, 2))
    return (out + np.swapaxes(out, 1, 2)) / 2 / unit[:, None] / unit, size
