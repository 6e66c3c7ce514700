"""Reference motions of the motors over time, from a table or from point to point."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..assembly.assemble import assemble
from ..assembly.redundancy import LEAST
from ..compiled import Pieces
from ..errors import AssemblyError, ModelError, TrajectoryError
from ..simulation.events import QUINTIC
from ..spatial import Array, Index, Mask
from ..structure.robot import HybridRobot
from ..tables.columns import read_layout
from ..tables.opening import open_table
from ..tables.trajectory import TableMotion, read_motions


@dataclass(frozen=True, eq=False)
class MotorAxes:
    """Indices of the motors' positions and rates in q and v.

    Attributes:
        at: Index of the first coordinate in q, shape (motors,).
        columns: Index of the coordinate in v, shape (motors,).
        turns: Whether q holds cosine and sine (continuous joints), shape (motors,).
    """

    at: Index
    columns: Index
    turns: Mask

    @staticmethod
    def of(robot: HybridRobot) -> MotorAxes:
        """Find the motors of a robot in q and v.

        Raises:
            ModelError: A motor has several freedoms.
        """
        numbers = [robot.joint_index[name] for name in robot.motors]
        for name, i in zip(robot.motors, numbers, strict=True):
            if robot.v_slices[i].stop - robot.v_slices[i].start != 1:
                raise ModelError(f"motor '{name}' has several freedoms: no controller is made for it")
        return MotorAxes(
            robot.motor_q,
            robot.motor_v,
            np.array([robot.kinds[i].endless for i in numbers], dtype=bool),
        )

    def positions(self, q: Array) -> Array:
        """Return the motors' positions, shape (..., motors); for continuous joints the angle in [-pi, pi]."""
        x: Array = q[..., self.at]
        if self.turns.any():
            x[..., self.turns] = np.arctan2(q[..., self.at[self.turns] + 1], x[..., self.turns])
        return x

    def error(self, desired: Array, q: Array) -> Array:
        """Compute the position errors x_d - x, shape (motors,); for continuous joints in [-pi, pi)."""
        return self.shortest(desired - self.positions(q))

    def shortest(self, step: Array) -> Array:
        """Reduce steps of continuous joints to [-pi, pi)."""
        return np.where(self.turns, (step + np.pi) % (2 * np.pi) - np.pi, step)


@dataclass(frozen=True, eq=False)
class Reference:
    """A reference motion: quintic polynomials between times of known position, rate and acceleration.

    Attributes:
        time: Strictly increasing times, shape (T,), [s].
        x: Positions, rates and accelerations of the motors at these times, shape (3, T, motors).
        holds: Whether the motors stay at the last position after the last time; else the motion ends there.
        guess: A posture near the start, shape (nq,).
    """

    time: Array
    x: Array
    holds: bool
    guess: Array

    @cached_property
    def pieces(self) -> Pieces:
        """The polynomials between the times, and the rest after them."""
        if len(self.time) == 1:
            h, starts = np.ones(1), np.stack([self.x[0], self.x[1], self.x[2] / 2])
            c = np.concatenate([starts, np.zeros_like(self.x)])
        else:
            h = np.diff(self.time)
            scale = np.stack([np.ones_like(h), h, h * h])[:, :, None]
            ends = np.concatenate([self.x[:, :-1] * scale, self.x[:, 1:] * scale])
            ends[3] -= ends[0]  # differences keep digits where positions are large
            ends[0] = 0.0
            c = np.einsum("nk,npm->kpm", QUINTIC, ends)
            c[0] = self.x[0, :-1]
        rest = np.zeros((6, 1, c.shape[2]))
        rest[0] = self.x[0, -1:]
        whole = np.ascontiguousarray(np.concatenate([c, rest], axis=1).transpose(1, 0, 2))
        bounds = self.time if len(self.time) > 1 else np.repeat(self.time, 2)
        return Pieces(bounds, np.append(h, 1.0), whole, self.holds)

    def at(self, t: float) -> tuple[Array, Array, Array]:
        """Compute positions, rates and accelerations of the motors at a time, shape (motors,) each.

        Raises:
            TrajectoryError: The motion ends before that time.
        """
        x, x_dot, x_ddot = self.rows(np.array([t]))
        return x[0], x_dot[0], x_ddot[0]

    def rows(self, times: Array) -> tuple[Array, Array, Array]:
        """Compute positions, rates and accelerations of the motors at times (T,), shape (T, motors) each.

        Raises:
            TrajectoryError: The motion ends before a time.
        """
        self.pieces.check("the reference", times)
        return self.pieces.at(times)


@dataclass(frozen=True)
class RestPosture:
    """A posture at which the robot is at rest.

    Attributes:
        time: Time [s].
        joints: Positions of motors [m or rad]; the others stay at the position of the point before.
        platforms: Poses of links instead, as in `assemble`.
    """

    time: float
    joints: Mapping[str, float]
    platforms: Mapping[str, object]


def from_points(
    robot: HybridRobot, points: Sequence[RestPosture], start: Array, redundancy: str = LEAST
) -> Reference:
    """Build a motion from point to point in the motors' coordinates, at rest in each point.

    Args:
        points: The points, at increasing times, with names of motors; unless the first is at 0, the motion
            starts at `start`.
        start: Posture at time 0, shape (nq,).
        redundancy: The rule for freedoms that poses leave, as in `assemble`.

    Raises:
        AssemblyError: A point is out of reach.
    """
    axes, q = MotorAxes.of(robot), start
    times, rows = [0.0], [axes.positions(start)]
    if points[0].time == 0.0:
        times, rows = [], []
    for point in points:
        try:
            q, row = _posture(robot, axes, point, q, redundancy)
        except AssemblyError as error:
            error.within(f"the point at {point.time:g} s")
            raise
        times.append(point.time)
        rows.append(row if not rows else rows[-1] + axes.shortest(row - rows[-1]))
    x = np.zeros((3, len(rows), len(robot.motors)))
    x[0] = rows
    return Reference(np.array(times), x, True, start)


def _posture(
    robot: HybridRobot, axes: MotorAxes, point: RestPosture, q: Array, redundancy: str
) -> tuple[Array, Array]:
    """Compute a point's posture near q and its motor positions; without platforms, only motors move."""
    if point.platforms:
        motors, platforms = dict(point.joints), dict(point.platforms)
        out = assemble(robot, motors=motors, platforms=platforms, guess=q, redundancy=redundancy)[0]
        return out, axes.positions(out)
    row = axes.positions(q)
    for name, value in point.joints.items():
        row[robot.motors.index(name)] = value
    out = q.copy()
    out[axes.at] = np.where(axes.turns, np.cos(row), row)
    out[axes.at[axes.turns] + 1] = np.sin(row[axes.turns])
    return out, row


def from_table(robot: HybridRobot, path: str, redundancy: str = LEAST) -> Reference:
    """Build a motion from a table of motors, platforms or a mixture, as `hybridyn idm` reads it.

    Args:
        redundancy: The rule for freedoms that poses leave, as in `assemble`.

    Raises:
        TrajectoryError: The table is wrong, or has no time.
        AssemblyError: A row is out of reach.
    """
    from ..compiled import TableAssembler

    axes = MotorAxes.of(robot)
    motion = read_motion(robot, path)
    if motion.time is None:
        raise TrajectoryError("has no column 'time'", file=path)
    if all(name in motion.joints for name in robot.motors):
        x = np.stack([np.stack(motion.joints[name]) for name in robot.motors], axis=2)
        return Reference(motion.time, x, False, robot.home)
    try:
        q, v, a = TableAssembler(robot)(
            motors=motion.joints, platforms=motion.platforms, redundancy=redundancy
        )
    except AssemblyError as error:
        error.within(path)
        raise
    x = np.stack([np.array([axes.positions(row) for row in q]), v[:, axes.columns], a[:, axes.columns]])
    x[0][:, axes.turns] = np.unwrap(x[0][:, axes.turns], axis=0)
    return Reference(motion.time, x, False, q[0])


def read_motion(robot: HybridRobot, path: str) -> TableMotion:
    """Read a whole table of a motion; the pose of a moving base may be left out.

    Raises:
        TrajectoryError: The table is wrong.
    """
    with open_table(path) as table:
        posed = any(name.startswith(f"{robot.description.root}/pose/") for name in table.columns)
        layout = read_layout(
            table.columns, robot.description, motors=robot.motors,
            base=robot.base if posed else "fixed", file=table.file,
        )  # fmt: skip
        return TableMotion.joined([*read_motions(table, layout)])
