"""The table of a simulated motion, in the columns of a trajectory, so that it can be read back."""

from __future__ import annotations

from collections.abc import Sequence
from fnmatch import fnmatchcase

import numpy as np

from ..description.names import did_you_mean
from ..errors import TrajectoryError
from ..joints.kinds import JointKind, Turn
from ..spatial import Array, rotate, rotation_from_quaternion
from ..structure.robot import HybridRobot
from ..tables.columns import ENERGIES, RESIDUAL
from ..tables.signals import POSE, RATES, TWIST, joint_columns
from ..tables.tree_coordinates import base_acceleration
from .result import SimulationResult


def columns_of(robot: HybridRobot) -> list[str]:
    """Return the names of the columns: time, base, joints, efforts, energies, residual."""
    return [*state_columns(robot), *(f"{motor}/effort" for motor in robot.motors), *ENERGIES, RESIDUAL]


def state_columns(robot: HybridRobot) -> list[str]:
    """Return the names of the columns of a full state: time, base, joints."""
    out = ["time"]
    if robot.base != "fixed":
        root = robot.description.root
        out += [f"{root}/pose/{part}" for part in POSE]
        out += [f"{root}/{rate}/{part}" for rate in RATES for part in TWIST]
    for name, kind in _joints(robot):
        for quantity in ("position", *RATES):
            out += joint_columns(name, kind, quantity)
    return out


def rows_of(robot: HybridRobot, result: SimulationResult) -> Array:
    """Return the rows of a result in the order of `columns_of`, shape (T, columns)."""
    energies = np.column_stack([result.kinetic, result.potential, result.energy, result.residual])
    return np.hstack([state_rows(robot, result.t, result.q, result.v, result.a), result.tau, energies])


def state_rows(robot: HybridRobot, t: Array, q: Array, v: Array, a: Array) -> Array:
    """Return states in the order of `state_columns`, shape (T, columns).

    Args:
        t: Times, shape (T,), [s].
        q: Positions, shape (T, nq).
        v: Rates, shape (T, nv).
        a: Accelerations, shape (T, nv).
    """
    parts = [t[:, None]]
    if robot.base != "fixed":
        R = rotation_from_quaternion(q[:, 3:7])
        parts += [q[:, :7], rotate(R, v[:, :3]), rotate(R, v[:, 3:6]), base_acceleration(q, v, a)]
    for name, kind in _joints(robot):
        i = robot.joint_index[name]
        freedoms = robot.v_slices[i]
        parts += [_position(kind, t, q[:, robot.q_slices[i]], v[:, freedoms]), v[:, freedoms], a[:, freedoms]]
    return np.hstack(parts)


def picked(columns: Sequence[str], patterns: Sequence[str] | None) -> list[int]:
    """Return the indices of the columns that match patterns like "*/effort", and of the time; None means all.

    Raises:
        TrajectoryError: A pattern matches no column.
    """
    if patterns is None:
        return [*range(len(columns))]
    for pattern in patterns:
        if not any(fnmatchcase(column, pattern) for column in columns):
            raise TrajectoryError(f"'{pattern}' matches no column{did_you_mean(pattern, columns)}")
    return [
        i for i, column in enumerate(columns)
        if column == "time" or any(fnmatchcase(column, pattern) for pattern in patterns)
    ]  # fmt: skip


def _joints(robot: HybridRobot) -> list[tuple[str, JointKind]]:
    """Return name and kind of each joint, without the root joint of a moving base."""
    pairs = zip(robot.joints, robot.kinds, strict=True)
    return [(name, kind) for i, (name, kind) in enumerate(pairs) if i or robot.base == "fixed"]


def _position(kind: JointKind, t: Array, q: Array, v: Array) -> Array:
    """Return positions as tables store them: an angle for cosine and sine, turns counted by the rates."""
    if kind.turn is not Turn.CIRCLE:
        return q
    angle = np.arctan2(q[:, -1], q[:, -2])
    turned = np.diff(t) * (v[1:, -1] + v[:-1, -1]) / 2
    angle[1:] += 2 * np.pi * np.cumsum(np.round((turned - np.diff(angle)) / (2 * np.pi)))
    return np.column_stack([q[:, :-2], angle])
