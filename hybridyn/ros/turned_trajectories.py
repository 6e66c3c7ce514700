"""Trajectories of output joints turned into those of motors, and back; limits are checked."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..assembly.posture import check_joints, joints_that_stay, modules_of, positions_of
from ..dynamics.quantities.joint_map import motors_beside
from ..errors import TrajectoryError
from ..spatial import Array
from ..streams.departures import Departures, departures
from .joint_numbers import checked_numbers
from .ros_model import RosModel


class JointPoint(NamedTuple):
    """A point of a trajectory, as `trajectory_msgs/JointTrajectoryPoint` holds it.

    Attributes:
        time: Time from the start [ns].
        positions: Shape (n,), [m or rad].
        velocities: Shape (n,), [m/s or rad/s]; empty where there are none.
        accelerations: Shape (n,), [m/s^2 or rad/s^2]; empty where there are none.
        effort: Shape (n,), [N or N m]; empty where there are none.
    """

    time: int
    positions: Sequence[float]
    velocities: Sequence[float] = ()
    accelerations: Sequence[float] = ()
    effort: Sequence[float] = ()


def turned(
    model: RosModel, names: Sequence[str], points: Sequence[JointPoint], q: Array, *, efforts: bool = False
) -> tuple[tuple[str, ...], list[JointPoint]]:
    """Return the trajectory of the motors from one of other joints, or that of the outputs from the motors.

    Rates and accelerations are turned where they are given. Where both are, the efforts that the motion needs
    must be within their limits, unless the robot has joints that nothing drives. Modules without one of the
    joints stay.

    Args:
        model: The robot's model, which knows the outputs.
        names: Joints of the trajectory.
        points: Its points.
        q: Posture before it, shape (nq,).
        efforts: Whether points of motors have the efforts, too.

    Returns:
        Names and points of the other trajectory.

    Raises:
        HybridynError: The trajectory is wrong, is out of reach, leaves the assembly branch of the
            posture, or exceeds a limit of a joint at a point.
    """
    robot = model.robot
    check_joints(robot, names)
    levels = _levels(names, points)
    to_motors = not set(names) <= {*robot.motors}
    others = motors_beside(robot, names) if to_motors else _outputs_beside(model, names)
    motion = {name: tuple(level[:, i] for level in levels) for i, name in enumerate(names)}
    q, v, a = model.along(motion, q, joints_that_stay(robot, names))
    tau = model.efforts(q, v, a) if len(levels) == 3 and to_motors and not model.undriven else None
    _check_limits(model, points, q, v, tau)
    at = [robot.v_slices[robot.joint_index[name]].start for name in others]
    each = [positions_of(robot, q, others), *(x[:, at] for x in (v, a)[: len(levels) - 1])]
    rows = [[x[t].tolist() for x in each] + [[]] * (3 - len(each)) for t in range(len(points))]
    if efforts and tau is not None:
        chosen = [robot.motors.index(name) for name in others]
        rows = [[*row, tau[t, chosen].tolist()] for t, row in enumerate(rows)]
    return others, [JointPoint(point.time, *row) for point, row in zip(points, rows, strict=True)]


def _outputs_beside(model: RosModel, motors: Sequence[str]) -> tuple[str, ...]:
    """Return the outputs of the modules that hold motors.

    Raises:
        TrajectoryError: There are none.
    """
    robot = model.robot
    moved = modules_of(robot, motors)
    found = tuple(name for name in model.outputs if modules_of(robot, [name])[0] in moved)
    if not found:
        raise TrajectoryError(
            "the trajectory is of motors, and no output joint is in their modules: name outputs in the "
            "parameter 'joints'"
        )
    return found


def _check_limits(
    model: RosModel, points: Sequence[JointPoint], q: Array, v: Array, tau: Array | None
) -> None:
    """Refuse a trajectory that exceeds a limit.

    Raises:
        TrajectoryError: It does.
    """
    left = Departures()
    left.add(departures(model.robot, q, v, tau), 1, np.array([point.time / 1e9 for point in points]))
    if lines := left.lines():
        raise TrajectoryError(lines[0].replace("row ", "point "))


def _levels(names: Sequence[str], points: Sequence[JointPoint]) -> list[Array]:
    """Return positions, then rates and accelerations as far as all points have them, shape (T, n) each.

    Raises:
        TrajectoryError: There is no point, times do not increase, or numbers are missing or not finite.
    """
    if not names or not points:
        raise TrajectoryError("the trajectory has no joint" if not names else "the trajectory has no point")
    out = list[Array]()
    for what in ("positions", "velocities", "accelerations"):
        rows = [getattr(point, what) for point in points]
        if what != "positions" and not any(map(len, rows)):
            break
        out.append(np.array([checked_numbers(names, row, what) for row in rows]))
    times = np.array([point.time for point in points])
    if (times[1:] <= times[:-1]).any():
        late = int(np.argmax(times[1:] <= times[:-1])) + 2
        raise TrajectoryError(f"the time of point {late} is not after that of the point before")
    return out
