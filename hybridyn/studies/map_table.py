"""The map between motors and output joints as a table, along a motion or over a grid.

<joint>/position, <motor>/position       [m or rad]
<motor>/per/<joint>                      d(motor)/d(joint)
<joint>/inertia/<joint>                  of the rotors that the robot's files state, at the joints
<joint>/velocity, <joint>/acceleration   of a motion, and <motor>/... the same
<joint>/effort, <motor>/effort           of a motion whose table has efforts on one side
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from ..assembly.posture import check_joints, holding, positions_of, posture_at
from ..dynamics.quantities.joint_map import JointMap
from ..effects.joint_laws import RotorInertia
from ..errors import AssemblyError, HybridynError
from ..spatial import Array
from ..structure.robot import HybridRobot


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


def _named(names: Sequence[str], quantity: str, values: Array) -> dict[str, Array]:
    return {f"{name}/{quantity}": values[:, i] for i, name in enumerate(names)}


def _columns(robot: HybridRobot, joints: Sequence[str]) -> list[int]:
    """Return the entries of v of joints with one freedom."""
    return [robot.v_slices[robot.joint_index[name]].start for name in joints]
