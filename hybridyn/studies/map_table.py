"""The map between motors and output joints as a table, along a motion or over a grid.

<joint>/position, <motor>/position       [m or rad]
<motor>/per/<joint>                      d(motor)/d(joint)
<joint>/inertia/<joint>                  of the rotors that the robot's files state, at the joints
<joint>/velocity, <joint>/acceleration   of a motion, and <motor>/... the same
<joint>/effort, <motor>/effort           of a motion whose table has efforts on one side
<motor>/current, <motor>/voltage         of its DC motors [A], [V]
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from ..assembly.posture import check_joints, holding, positions_of, posture_at
from ..dynamics.quantities.joint_map import JointMap, motors_beside
from ..effects.joint_laws import RotorInertia
from ..errors import AssemblyError, HybridynError
from ..spatial import Array
from ..structure.robot import HybridRobot
from ..tables.columns import SUPPLY

if TYPE_CHECKING:
    from ..effects.dc_motors import OnDcMotors


def map_columns(
    robot: HybridRobot, joints: Sequence[str], *, motion: bool = False, efforts: bool = False,
    dc: OnDcMotors | None = None,
) -> list[str]:  # fmt: skip
    """Return the names of the columns of `map_rows`.

    Args:
        joints: The output joints.
        motion: Whether the rows have rates and accelerations.
        efforts: Whether they have efforts.
        dc: DC motors, of which they then have currents and voltages, or None.
    """
    motors = motors_beside(robot, joints)
    both = (*joints, *motors)
    out = [f"{name}/position" for name in both]
    out += [f"{motor}/per/{joint}" for motor in motors for joint in joints]
    if _rotors(robot, motors).any():
        out += [f"{joint}/inertia/{joints[j]}" for i, joint in enumerate(joints) for j in _from(i, joints)]
    quantities = [*(("velocity", "acceleration") if motion else ()), *(("effort",) if efforts else ())]
    out += [f"{name}/{quantity}" for quantity in quantities for name in both]
    supplied = [robot.motors[i] for i in _supplied(robot, motors, dc)] if efforts else []
    return [*out, *(f"{motor}/{what}" for what in SUPPLY for motor in supplied)]


def map_rows(
    found: JointMap, v: Array | None = None, a: Array | None = None, tau: Array | None = None,
    dc: OnDcMotors | None = None,
) -> Array:  # fmt: skip
    """Return the rows of a map at many postures, shape (T, columns).

    Args:
        found: The map, at T postures.
        v: Rates of the robot, shape (T, nv), or None for a map without motion.
        a: Accelerations, shape (T, nv), with `v`.
        tau: Efforts of the robot's motors, shape (T, motors), or None where they are not wanted.
        dc: DC motors, of which currents and voltages are wanted with the efforts, or None.
    """
    H, robot, joints = found.motors_per_joints, found.robot, found.joints
    out = [found.joint_positions, found.motor_positions, H.reshape(len(H), -1)]
    rotors = _rotors(robot, found.motors)
    if rotors.any():
        inertia = found.at_joints(rotors)
        out += [inertia[:, i, j, None] for i in range(len(joints)) for j in _from(i, joints)]
    both = [robot.v_slices[robot.joint_index[name]].start for name in (*joints, *found.motors)]
    out += [rates[:, both] for rates in (v, a) if rates is not None]
    if tau is not None:
        efforts = tau[:, [robot.motors.index(motor) for motor in found.motors]]
        out += [found.joint_efforts(efforts), efforts]
        if dc is not None and v is not None:
            kept = np.isin(dc.motors, _supplied(robot, found.motors, dc))
            out += [x[:, kept] for x in (dc.currents(tau), dc.voltages(tau, v[:, robot.motor_v]))]
    return np.hstack(out)


def _supplied(robot: HybridRobot, motors: Sequence[str], dc: OnDcMotors | None) -> list[int]:
    """Return the numbers of the DC motors among some motors."""
    return [] if dc is None else [int(i) for i in dc.motors if robot.motors[i] in motors]


def _rotors(robot: HybridRobot, motors: Sequence[str]) -> Array:
    """Return the inertia of the motors' rotors, at the motors' joints; 0 where none is stated."""
    stated = RotorInertia().numbers(robot)
    return np.array([stated.get(motor, (0.0,))[0] for motor in motors])


def _from(i: int, joints: Sequence[str]) -> range:
    """Return the numbers of a joint and of those after it."""
    return range(i, len(joints))


def conditions(robot: HybridRobot, joints: Sequence[str], rows: Array) -> Array:
    """Compute the condition number of H in each row of a map, shape (T,)."""
    motors = motors_beside(robot, joints)
    first = len(joints) + len(motors)  # positions come before
    H = rows[:, first : first + len(motors) * len(joints)].reshape(len(rows), len(motors), len(joints))
    s = np.linalg.svd(H, compute_uv=False)
    return s[:, 0] / s[:, -1] if s.size else np.ones(len(rows))


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
