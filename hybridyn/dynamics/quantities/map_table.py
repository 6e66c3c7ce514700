"""The map between motors and output joints as a table: columns of positions, of H, and of a motion's rates.

<joint>/position, <motor>/position       [m or rad]
<motor>/per/<joint>                      d(motor)/d(joint)
<joint>/inertia/<joint>                  of the rotors that the robot's files state, at the joints
<joint>/velocity, <joint>/acceleration   of a motion, and <motor>/... the same
<joint>/effort, <motor>/effort           of a motion whose table has efforts on one side
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...effects.joint_laws import RotorInertia
from ...errors import SingularityError
from ...spatial import Array
from ...structure.robot import HybridRobot
from .joint_map import JointMap, joint_map


@dataclass(frozen=True, eq=False)
class MapTable:
    """Rows of a map.

    Attributes:
        rows: Numbers, shape (T, columns).
        condition: Condition number of H at each row, shape (T,).
    """

    columns: tuple[str, ...]
    rows: Array
    condition: Array


def map_table(
    found: JointMap, v: Array | None = None, a: Array | None = None, tau: Array | None = None
) -> MapTable:
    """Return the rows of a map at many postures.

    Args:
        found: The map, at T postures.
        v: Rates of the robot, shape (T, nv), or None for a map without motion.
        a: Accelerations, shape (T, nv), with `v`.
        tau: Efforts of the robot's motors, shape (T, motors), or None where they are not wanted.
    """
    H, out = found.motors_per_joints, _named(found.joints, "position", found.joint_positions)
    out |= _named(found.motors, "position", found.motor_positions)
    for i, motor in enumerate(found.motors):
        for j, joint in enumerate(found.joints):
            out[f"{motor}/per/{joint}"] = H[:, i, j]
    stated = RotorInertia().numbers(found.robot)
    rotors = np.array([stated.get(motor, (0.0,))[0] for motor in found.motors])
    if rotors.any():
        inertia = found.at_joints(rotors)
        for i, joint in enumerate(found.joints):
            for j, other in enumerate(found.joints[i:], start=i):
                out[f"{joint}/inertia/{other}"] = inertia[:, i, j]
    for name, rates in (("velocity", v), ("acceleration", a)):
        if rates is not None:
            for side in (found.joints, found.motors):
                out |= _named(side, name, rates[:, _columns(found.robot, side)])
    if tau is not None:
        efforts = tau[:, [found.robot.motors.index(motor) for motor in found.motors]]
        out |= _named(found.joints, "effort", found.joint_efforts(efforts))
        out |= _named(found.motors, "effort", efforts)
    s = np.linalg.svd(H, compute_uv=False)
    condition = s[:, 0] / s[:, -1] if s.size else np.ones(len(H))
    return MapTable(tuple(out), np.stack(list(out.values()), axis=1), condition)


def regular_map(robot: HybridRobot, q: Array, joints: Sequence[str]) -> tuple[JointMap | None, list[int]]:
    """Compute the map at the postures that are not singular.

    Args:
        q: Positions, shape (T, nq).

    Returns:
        The map, or None if no posture is left, and the samples that are.

    Raises:
        SingularityError: The joints do not fit the modules, whatever the posture.
    """
    found, kept = _regular(robot, q, joints, list(range(len(q))))
    if found is None and kept:
        found = joint_map(robot, q[kept], joints)
    return found, kept


def _regular(
    robot: HybridRobot, q: Array, joints: Sequence[str], samples: list[int]
) -> tuple[JointMap | None, list[int]]:
    """Return those of some samples that are not singular, and their map if it is all of them.

    An error names one singular sample: it is dropped, and the halves of the others are computed apart. The
    work grows with T log T at most, whatever the number of singular samples.
    """
    if not samples:
        return None, []
    try:
        return joint_map(robot, q[samples], joints), samples
    except SingularityError as error:
        if error.sample is None or error.what == "independent coordinates":
            raise
        rest = samples[: error.sample] + samples[error.sample + 1 :]
    half = len(rest) // 2
    return None, [i for part in (rest[:half], rest[half:]) for i in _regular(robot, q, joints, part)[1]]


def _named(names: Sequence[str], quantity: str, values: Array) -> dict[str, Array]:
    return {f"{name}/{quantity}": values[:, i] for i, name in enumerate(names)}


def _columns(robot: HybridRobot, joints: Sequence[str]) -> list[int]:
    """Return the entries of v of joints with one freedom."""
    return [robot.v_slices[robot.joint_index[name]].start for name in joints]
