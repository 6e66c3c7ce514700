"""What links feel like through the loops: J M^-1 J^T over wrenches on them (Delassus), and its inverse.

The direct model at rest, under unit wrenches and nothing else, gives the columns, each linear in the modules;
M is never formed. All motions of the robot count, also those that no motor drives.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from ...effects.choice import Choice, Effects
from ...errors import AT_SAMPLE, SingularityError
from ...linkage.elimination import back_substitute, pivot_ratio, pivoted_qr
from ...linkage.tree import Motion
from ...spatial import Array, Index, rotate_back
from ...structure.robot import HybridRobot
from ...structure.samples import as_positions, one_of
from ..direct import direct_model
from ..link_motion import link_motions, named_links
from .bias import chosen_effects

#: Links whose Delassus matrix has a smaller reciprocal condition cannot be moved in some direction.
IMMOVABLE = 1e-10
#: Effects that inertia is made of.
INERTIAL = ("inertia", "leg_inertia", "rotor_inertia")


def delassus(
    robot: HybridRobot,
    q: ArrayLike,
    links: str | Sequence[str],
    *,
    axes: str = "world",
    effects: Choice = None,
) -> Array:
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
    """
    names = [links] if isinstance(links, str) else list(links)
    named_links(robot, names)
    one_of("axes", axes, "world", "link")
    on = chosen_effects(robot, effects).only(INERTIAL)
    q, single = as_positions(robot, q)
    T, rows = len(q), 6 * len(names)
    try:
        twists = _pushed(robot, q, names, axes, on, np.arange(rows))
    except SingularityError as error:
        if error.sample is not None:
            error.sample %= T  # one of the batch, each of which is pushed `rows` times
        raise
    out = np.swapaxes(twists.reshape(rows, T, rows), 0, 1)
    out = (out + np.swapaxes(out, 1, 2)) / 2
    return out[0] if single else out


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
    """
    D = delassus(robot, q, links, axes=axes, effects=effects)
    return inverse_of(robot, D[None], links)[0] if D.ndim == 2 else inverse_of(robot, D, links)


def inverse_of(
    robot: HybridRobot, D: Array, links: str | Sequence[str], immovable: float = IMMOVABLE
) -> Array:
    """Compute the inverses of Delassus matrices by QR with column pivoting.

    Args:
        D: The matrices of some links, shape (T, 6 k, 6 k).
        links: The links, for messages.
        immovable: Reciprocal condition number, scaled by the robot's size, that is refused.

    Raises:
        SingularityError: The links cannot be moved in every direction.
    """
    rows = D.shape[1]
    unit = np.tile([robot.bodies.size] * 3 + [1.0] * 3, rows // 6)
    right = np.broadcast_to(np.eye(rows), D.shape)
    R, order = pivoted_qr(np.concatenate([D / unit[:, None] / unit, right], axis=2), rows, rows)
    lost = np.flatnonzero(pivot_ratio(R, rows) < immovable)
    if len(lost):
        t = int(lost[0])
        ratio = float(pivot_ratio(R[t : t + 1], rows)[0])
        condition = 1 / ratio if ratio > 0 else np.inf
        names = links if isinstance(links, str) else ", ".join(links)
        raise SingularityError(
            f"links {names}: they cannot be moved in every direction{AT_SAMPLE} (condition number "
            f"{condition:.1e}, limit {1 / immovable:.0e}), and have no operational-space inertia. Take "
            "hybridyn.delassus, its inverse, which always exists",
            what="operational inertia",
            condition=condition,
            sample=t,
        )
    out = np.empty_like(D)
    np.put_along_axis(out, order[:, :, None], back_substitute(R[:, :, :rows], R[:, :, rows:]), axis=1)
    inertia: Array = (out + np.swapaxes(out, 1, 2)) / 2 / unit[:, None] / unit
    return inertia


def _pushed(
    robot: HybridRobot, q: Array, names: list[str], axes: str, on: Effects, directions: Index
) -> Array:
    """Compute the accelerations of k links per unit wrench in some of their 6 k directions, from rest.

    Returns:
        Shape (directions T, 6 k), the samples of the first direction first.

    Raises:
        HybridynError: As the direct model raises; its samples are the rows of the result.
    """
    many = np.tile(q, (len(directions), 1))
    rest = np.zeros((len(many), robot.nv))
    units = np.repeat(np.eye(6 * len(names))[directions].reshape(-1, len(names), 6), len(q), axis=0)
    placed = link_motions(robot, many, rest, names)
    wrenches = {name: np.zeros((len(many), 6)) for name in names}
    for i, name in enumerate(names):
        wrenches[name] += _in_link(placed[name], units[:, i]) if axes == "world" else units[:, i]
    still = np.zeros((len(many), len(robot.motors)))
    a = direct_model(robot, many, rest, still, wrenches=wrenches, effects=on).a
    moved = link_motions(robot, many, a, names)
    return np.concatenate([_twist(moved[name], axes) for name in names], axis=1)


def _in_link(motion: Motion, W: Array) -> Array:
    """Turn wrenches from world axes to those of a link, shape (T, 6)."""
    return np.concatenate([rotate_back(motion.R, W[:, :3]), rotate_back(motion.R, W[:, 3:])], axis=1)


def _twist(motion: Motion, axes: str) -> Array:
    """Return a link's twist in world axes or its own, shape (T, 6)."""
    twist = np.concatenate([motion.p_dot, motion.w], axis=1)
    return twist if axes == "world" else _in_link(motion, twist)
