"""Postures from positions of a few joints, driven or not, and over a grid of them."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from itertools import product

import numpy as np
from numpy.typing import ArrayLike

from ...assembly.assemble import assemble
from ...errors import AssemblyError, HybridynError, TrajectoryError
from ...linkage.joints import NV
from ...spatial import Array
from ...structure.building import build_robot
from ...structure.module import Module
from ...structure.robot import HybridRobot, joint_position
from .independent import check_joints


def modules_of(robot: HybridRobot, joints: Sequence[str]) -> list[int]:
    """Return the numbers of the modules that hold joints.

    Raises:
        TrajectoryError: No joint is named, or a prescribed base's is.
    """
    owners = {robot.body_owner[robot.body_of_joint[name]][0] for name in joints}
    if not owners or -1 in owners:
        raise TrajectoryError("joints: name the output joints, those of one module at least")
    return sorted(owners)


def positions_of(robot: HybridRobot, q: Array, joints: Sequence[str]) -> Array:
    """Return the positions of joints with one freedom, shape (T, joints).

    Those of continuous joints are within half a turn.
    """
    out = np.zeros((len(q), len(joints)))
    for i, name in enumerate(joints):
        out[:, i] = joint_position(robot, q, name)
    return out


def holding(robot: HybridRobot, joints: Iterable[str]) -> HybridRobot:
    """Return the robot, or one with the same q in which none of these joints is cut away in a wrist.

    Positions of joints in cut wrists cannot be prescribed.
    """
    cut = robot.cut_joints & set(joints)
    if not cut:
        return robot
    return build_robot(
        robot.description, base=robot.base, gravity=robot.gravity, rank_tolerance=robot.rank_tolerance,
        closure_tolerance=robot.closure_tolerance, held=robot.held | cut, payloads=robot.payloads,
    )  # fmt: skip


def posture_at(
    robot: HybridRobot,
    positions: Mapping[str, ArrayLike],
    guess: Array | None = None,
    close: Callable[..., tuple[Array, Array, Array]] | None = None,
) -> Array:
    """Assemble a posture from positions of some modules' joints; the joints of all others stay.

    Args:
        robot: The robot (`holding` these joints).
        positions: A position, a number or shape (T,), by joint.
        guess: A posture near it, shape (nq,); home where left out.
        close: Closes the loops like `hybridyn.assemble` of this robot, which does it where left out.

    Returns:
        Positions of the spanning tree, shape (nq,) or (T, nq).

    Raises:
        AssemblyError: The positions are out of reach, or do not determine the posture.
        TrajectoryError: An unknown joint, or a position that is not finite.
    """
    check_joints(robot, list(positions))
    moved = modules_of(robot, list(positions))
    near = robot.home if guess is None else guess
    others = [j for k, module in enumerate(robot.modules) if k not in moved for j in _held_joints(module)]
    held = dict(zip(others, positions_of(robot, near[None], others)[0], strict=True))
    given = {name: (value, 0.0, 0.0) for name, value in {**held, **positions}.items()}
    close = partial(assemble, robot) if close is None else close
    return close(motors=given, guess=guess)[0]


def _held_joints(module: Module) -> Iterator[str]:
    """Yield the joints that hold a module: its motors, or in a tree every joint with one freedom."""
    if module.closures:
        yield from module.motors
        return
    for name, joint in zip(module.joints, module.mechanism.spanning.joints, strict=True):
        if NV[joint.kind] == 1:
            yield name


def postures_on_grid(robot: HybridRobot, values: Mapping[str, Array]) -> Iterator[tuple[Array, Array | None]]:
    """Assemble a posture at every point of a grid of joint positions, from the point nearest to home on.

    Each joint's positions increase. A point's guess is the posture of a neighbour that was found: all belong
    to home's assembly branch. Points behind a gap are found around it.

    Yields:
        For each point, the last joint's position changing first: the positions, shape (joints,), and the
        posture, shape (nq,), or None where the loops do not close.

    Raises:
        HybridynError: Not a single point can be assembled: what the point nearest to home meets.
    """
    robot, names, sizes = holding(robot, values), list(values), [len(x) for x in values.values()]
    check_joints(robot, names)
    at_home = positions_of(robot, robot.home[None], names)[0]
    start = [int(np.argmin(np.abs(values[name] - x))) for name, x in zip(names, at_home, strict=True)]
    found: dict[tuple[int, ...], Array | None] = {}
    first: HybridynError | None = None
    waiting = deque([(tuple(start), robot.home)])  # points to try, from a neighbour's posture
    while waiting:
        point, near = waiting.popleft()
        if point in found or not all(0 <= i < size for i, size in zip(point, sizes, strict=True)):
            continue
        at = {name: float(values[name][i]) for name, i in zip(names, point, strict=True)}
        try:
            found[point] = q = posture_at(robot, at, near)
            waiting.extend((neighbour, q) for neighbour in _neighbours(point))
        except AssemblyError as error:
            found[point], first = None, first or error
    if first and not any(q is not None for q in found.values()):
        raise first
    for point in product(*map(range, sizes)):
        yield np.array([values[name][i] for name, i in zip(names, point, strict=True)]), found.get(point)


def _neighbours(point: tuple[int, ...]) -> Iterator[tuple[int, ...]]:
    """Yield the neighbours of a point of the grid."""
    for i, step in product(range(len(point)), (-1, 1)):
        yield (*point[:i], point[i] + step, *point[i + 1 :])
