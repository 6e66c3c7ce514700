"""Moves of one module, or of one link with all modules below it, along paths of closed loops."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..spatial import Array
from ..structure.robot import HybridRobot, joint_position
from .assemble import assemble_modules
from .chain.coupling import chains_of
from .chain.solve import assemble_chain
from .module_request import module_request
from .redundancy import LEAST
from .requests import gather_requests, in_root


def move_module(robot: HybridRobot, number: int, joints: Mapping[str, float], guess: Array) -> Array:
    """Move joints of one module along a path of closed loops; the other modules keep their positions.

    Args:
        number: Index of the module.
        joints: New position by joint name (joints with one freedom), [m or rad]; with the closures they
            determine the module's posture.
        guess: Initial posture of the robot with closed loops, shape (nq,).

    Returns:
        Posture of the robot on the same assembly branch, shape (nq,).

    Raises:
        AssemblyError: As in `assemble`.
        TrajectoryError: As in `assemble`.
    """
    module = robot.modules[number]
    q = np.tile(np.asarray(guess, dtype=float), (2, 1))
    path = {name: np.array([joint_position(robot, q[0], name), value]) for name, value in joints.items()}
    requests = gather_requests(robot, path, {})
    request = module_request(requests, robot, number, {})
    assemble_modules(robot, [(module, request)], q, *np.zeros((2, 2, robot.nv)))
    out: Array = q[1]
    return out


def move_link(
    robot: HybridRobot,
    link: str,
    way: Mapping[str, Array] | Array,
    guess: Array,
    redundancy: str = LEAST,
) -> Array:
    """Move a link along a path of closed loops; modules that do not move it keep their positions.

    Args:
        robot: The robot.
        link: "link" or "link@other".
        way: Its present and its new pose in the other link, shape (2, 7), or some coordinates, shape (2,)
            each [m or rad].
        guess: Initial posture of the robot with closed loops, shape (nq,).
        redundancy: The rule for freedoms that the pose leaves, as in `assemble`.

    Returns:
        Posture of the robot on the same assembly branch, shape (nq,).

    Raises:
        AssemblyError: As in `assemble`.
        TrajectoryError: As in `assemble`.
    """
    requests = in_root(robot, gather_requests(robot, {}, {link: (way,)}, redundancy=redundancy), guess)
    q, still = np.tile(np.asarray(guess, dtype=float), (2, 1)), np.zeros((2, 2, robot.nv))
    alone, chains = chains_of(robot, requests)
    for chain in chains:
        assemble_chain(robot, requests, chain, q[0].copy(), q, *still)
    for one in alone.poses:
        number = robot.body_owner[robot.bodies.place[one.link][0]][0]
        request = module_request(alone, robot, number, {})
        assemble_modules(robot, [(robot.modules[number], request)], q, *still)
    out: Array = q[1]
    return out
