"""Compute poses, twists and accelerations of links in the world."""

from collections.abc import Container, Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ..description.names import did_you_mean
from ..errors import TrajectoryError
from ..linkage.motion import Motion
from ..spatial import Array, cross, quaternion_from_rotation, rotate, rotation_from_quaternion
from ..structure.robot import HybridRobot
from ..structure.samples import as_accelerations, as_positions, as_rates, same_samples


class LinkMotion(NamedTuple):
    """Motion of one link in the world; leading axis T dropped for a single sample.

    Attributes:
        pose: Origin and quaternion x, y, z, qx, qy, qz, qw, shape (T, 7), [m].
        twist: Velocity of the origin, then angular velocity, shape (T, 6), [m/s, rad/s], world axes.
        acceleration: Time derivative of `twist` (classical), shape (T, 6), [m/s^2, rad/s^2], world axes.

    Example:
        >>> robot = hybridyn.load("five_bar")
        >>> q, v, a = hybridyn.assemble(robot, motors=([0.1, 0.2], [1.0, 0.0], [0.0, 0.0]))
        >>> motions = hybridyn.kinematics(robot, q, v, a)
        >>> motions["m1_tool"].acceleration.shape
        (6,)
    """

    pose: Array
    twist: Array
    acceleration: Array


def kinematics(
    robot: HybridRobot, q: Array, v: Array, a: Array | None = None, links: Sequence[str] | None = None
) -> dict[str, LinkMotion]:
    """Compute poses, twists and accelerations of links in the world.

    Args:
        robot: The robot.
        q: Positions, shape (nq,) or (T, nq).
        v: Rates, shape (nv,) or (T, nv).
        a: Accelerations, shape (nv,) or (T, nv); zero if None.
        links: Names of the links; all links if None.

    Returns:
        Motion of each link, by link name. Values match `pin.forwardKinematics` on `robot.model`
        (LOCAL_WORLD_ALIGNED, classical accelerations).

    Raises:
        TrajectoryError: An array has the wrong shape or is not finite, or a link is unknown.

    Example:
        >>> robot = hybridyn.load("five_bar")
        >>> q, v, a = hybridyn.assemble(robot, motors=([0.1, 0.2], [1.0, 0.0], [0.0, 0.0]))
        >>> tool = hybridyn.kinematics(robot, q, v, links=["m1_tool"])["m1_tool"]
        >>> tool.pose[:3].round(3), tool.twist[:3].round(3)
        (array([-0.057,  0.   , -0.566]), array([-0.192,  0.   ,  0.14 ]))
    """
    q, single = as_positions(robot, q)
    v = as_rates(robot, v)[0]
    accelerations = np.zeros_like(v) if a is None else as_accelerations(robot, a)[0]
    same_samples(**{"q": q, "v": v} | ({} if a is None else {"a": accelerations}))
    wanted = named_links(robot, links)
    return motions_of(robot, body_motions(robot, q, v, accelerations), wanted, single)


def named_links(robot: HybridRobot, links: Sequence[str] | None) -> Iterable[str]:
    """Return the requested links, or all links for None.

    Raises:
        TrajectoryError: A link is unknown.
    """
    for link in links or ():
        if link not in robot.bodies.place:
            raise TrajectoryError(f"unknown link '{link}'{did_you_mean(link, robot.bodies.place)}")
    return robot.bodies.place if links is None else links


def motions_of(
    robot: HybridRobot, bodies: Mapping[int, Motion], links: Iterable[str], single: bool
) -> dict[str, LinkMotion]:
    """Compute the motion of links from that of bodies.

    Args:
        bodies: Motion of each body, by number.
        links: Names of the links.
        single: Whether to drop the axis of samples.
    """
    out = {}
    for link in links:
        body, R, p = robot.bodies.place[link]
        m = bodies[body].then(Motion.at_rest(len(bodies[body].p), R, p))
        arrays = (
            np.concatenate([m.p, quaternion_from_rotation(m.R)], axis=1),
            np.concatenate([m.p_dot, m.w], axis=1),
            np.concatenate([m.p_ddot, m.w_dot], axis=1),
        )
        out[link] = LinkMotion(*(x[0] for x in arrays)) if single else LinkMotion(*arrays)
    return out


def link_motions(robot: HybridRobot, q: Array, v: Array, links: Iterable[str]) -> dict[str, Motion]:
    """Compute the motion of some links in the world at zero accelerations.

    Only the modules between the root and these links are computed.
    """
    places = {link: robot.bodies.place[link] for link in links}
    if not places:
        return {}
    wanted: set[int] = set()
    for body, _, _ in places.values():
        k = robot.body_owner[body][0]
        while k >= 0 and k not in wanted:
            wanted.add(k)
            k = robot.modules[k].parent
    bodies = body_motions(robot, q, v, np.zeros_like(v), wanted)
    return {link: bodies[b].then(Motion.at_rest(len(q), R, p)) for link, (b, R, p) in places.items()}


def body_motions(
    robot: HybridRobot, q: Array, v: Array, a: Array, modules: Container[int] | None = None
) -> dict[int, Motion]:
    """Compute the motion of bodies in the world.

    Args:
        q: Positions, shape (T, nq).
        v: Rates, shape (T, nv).
        a: Accelerations, shape (T, nv).
        modules: Numbers of the modules to compute, which must include all modules that carry them; all if
            None.
    """
    bodies = {0: _root(robot, q, v, a)}
    for k, module in enumerate(robot.modules):
        if (robot.base == "floating" and k == 0) or (modules is not None and k not in modules):
            continue
        base = bodies[robot.bodies.place[module.base][0]]
        motion = module.mechanism.spanning.sweep(
            q[:, module.q_index], v[:, module.v_index], a[:, module.v_index]
        )
        for i, joint in enumerate(module.joints):
            bodies[robot.body_of_joint[joint]] = base.then(motion.of_body(i + 1))
    return bodies


def all_bodies(robot: HybridRobot, q: Array, v: Array, a: Array | None = None) -> Motion:
    """Compute the motion of all bodies in the world, shapes (T, bodies, ...).

    Args:
        q: Positions, shape (T, nq).
        v: Rates, shape (T, nv).
        a: Accelerations, shape (T, nv); zero by default.
    """
    found = body_motions(robot, q, v, np.zeros_like(v) if a is None else a)
    each = zip(*(found[number].arrays for number in range(len(found))), strict=True)
    stacked = (np.stack(np.broadcast_arrays(*arrays), axis=1) for arrays in each)
    return Motion(*map(np.ascontiguousarray, stacked))  # so that sums over bodies round alike in any batch


def _root(robot: HybridRobot, q: Array, v: Array, a: Array) -> Motion:
    """Compute the motion of the root body in the world from its velocity in its own frame."""
    if robot.base == "fixed":
        return Motion.at_rest(len(q))
    R = rotation_from_quaternion(q[:, 3:7])
    classical = a[:, :3] + cross(v[:, 3:6], v[:, :3])
    return Motion(
        R, q[:, :3], rotate(R, v[:, 3:6]), rotate(R, v[:, :3]), rotate(R, a[:, 3:6]), rotate(R, classical)
    )
