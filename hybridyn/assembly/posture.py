"""Postures from positions of a few joints, driven or not."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from ..description.names import did_you_mean
from ..errors import TrajectoryError
from ..spatial import Array
from ..structure.building import rebuilt
from ..structure.module import Module
from ..structure.robot import HybridRobot, joint_position
from .assemble import assemble


def check_joints(robot: HybridRobot, names: Sequence[str]) -> None:
    """Refuse joints that cannot be coordinates.

    Raises:
        TrajectoryError: One is unknown, named twice, or has several freedoms.
    """
    for name in names:
        if name not in robot.joint_index:
            raise TrajectoryError(f"joints: unknown joint '{name}'{did_you_mean(name, robot.joint_index)}")
        if list(names).count(name) > 1:
            raise TrajectoryError(f"joints: '{name}' is named twice")
        kind = robot.kinds[robot.joint_index[name]]
        if kind.nv > 1:
            raise TrajectoryError(
                f"joints: '{name}' is {kind} and has {kind.nv} freedoms; independent coordinates are joints "
                "with one freedom each"
            )


def modules_of(robot: HybridRobot, joints: Sequence[str]) -> list[int]:
    """Return the numbers of the modules that hold joints.

    Raises:
        TrajectoryError: No joint is named, or a prescribed base's is.
    """
    owners = {robot.module_of(name) for name in joints}
    if not owners or -1 in owners:
        raise TrajectoryError("joints: name the output joints, those of one module at least")
    return sorted(owners)


def positions_of(robot: HybridRobot, q: Array, joints: Sequence[str]) -> Array:
    """Return the positions of joints with one freedom, shape (T, joints).

    Those of continuous joints are within half a turn.
    """
    return np.array([joint_position(robot, q, name) for name in joints]).reshape(len(joints), len(q)).T


def holding(robot: HybridRobot, joints: Iterable[str]) -> HybridRobot:
    """Return the robot, or one with the same q in which none of these joints is cut away in a wrist.

    Positions of joints in cut wrists cannot be prescribed.
    """
    cut = robot.cut_joints & set(joints)
    return rebuilt(robot, held=robot.held | cut) if cut else robot


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
    near = robot.home if guess is None else guess
    others = joints_that_stay(robot, list(positions))
    held = dict(zip(others, positions_of(robot, near[None], others)[0], strict=True))
    given = {name: (value, 0.0, 0.0) for name, value in {**held, **positions}.items()}
    close = partial(assemble, robot) if close is None else close
    return close(motors=given, guess=guess)[0]


def joints_that_stay(robot: HybridRobot, joints: Sequence[str]) -> list[str]:
    """Return the joints that hold the modules without one of some joints."""
    moved = modules_of(robot, joints)
    return [name for k, module in enumerate(robot.modules) if k not in moved for name in held_joints(module)]


def held_joints(module: Module) -> Sequence[str]:
    """Return the joints that hold a module: its motors, or in a tree every joint with one freedom."""
    if module.closures:
        return module.motors
    joints = zip(module.joints, module.mechanism.spanning.joints, strict=True)
    return [name for name, joint in joints if joint.kind.single]
