"""Write models/<robot>/traj.csv for the shipped robots: smooth, periodic, with analytic rates.

Every coordinate is a sum of two harmonics of the period, with an amplitude chosen for the robot and a phase
that follows from the coordinate's number, so that no two coordinates move alike and every run of this script
writes the same bytes. Units and column names are those of the trajectory tables: SI, `<joint>/position`,
`<link>@<other>/pose/...`, rates relative to `other`, in its axes, accelerations classical.

    python models/make_trajectories.py              every robot
    python models/make_trajectories.py lx4 snake    these only
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Columns = dict[str, Array]
Triple = tuple[float, float, float]

SAMPLES = 1001
GOLDEN_ANGLE = np.pi * (3.0 - np.sqrt(5.0))  # phases that never coincide, whatever the number of coordinates
POSE_DIGITS = 12  # seven numbers of a pose have to fit each other and the loops
JOINT_DIGITS = 6  # a joint's position stands alone: any value is one that the robot can take


def sinusoid(time: Array, harmonic: int, phase: float, amplitude: float) -> Array:
    """Return amplitude sin(omega t + phase), its rate and acceleration, shape (3, samples).

    The period of the first harmonic is the table's duration, time[-1].
    """
    omega = 2.0 * np.pi * harmonic / time[-1]
    sine, cosine = np.sin(omega * time + phase), np.cos(omega * time + phase)
    return amplitude * np.array([sine, omega * cosine, -(omega**2) * sine])


def wave(time: Array, number: int, amplitude: float, offset: float = 0.0) -> Array:
    """Return one coordinate's motion.

    Args:
        time: From zero to one period, shape (samples,), [s].
        number: Number of the coordinate in its robot, fixes harmonics and phase.
        amplitude: Bound of the deviation from `offset`.
        offset: Value to move about.

    Returns:
        Value, rate and acceleration, shape (3, samples).
    """
    phase = GOLDEN_ANGLE * (number + 1)
    motion = sinusoid(time, 1 + number % 2, phase, 0.7 * amplitude)
    motion += sinusoid(time, 3 + number % 3, phase, 0.3 * amplitude)
    motion[0] += offset
    return motion


def joint_columns(joint: str, motion: Array) -> Columns:
    """Name the columns of one joint's motion, shape (3, samples)."""
    return {f"{joint}/{what}": motion[i] for i, what in enumerate(("position", "velocity", "acceleration"))}


def rotation_motion(roll: Array, pitch: Array, yaw: Array) -> tuple[Array, Array, Array]:
    """Turn roll, pitch, yaw (R = Rz Ry Rx) and their rates into quaternion and angular rates.

    Args:
        roll: Value, rate, acceleration, shape (3, samples), [rad].
        pitch: Likewise.
        yaw: Likewise.

    Returns:
        Quaternion x, y, z, w, shape (4, samples); angular velocity and acceleration, shape (3, samples) each,
        in the axes of the fixed frame.
    """
    (cr, sr), (cp, sp), (cy, sy) = ((np.cos(a[0] / 2), np.sin(a[0] / 2)) for a in (roll, pitch, yaw))
    quaternion = np.array(
        [
            cy * cp * sr - sy * sp * cr,
            cy * sp * cr + sy * cp * sr,
            sy * cp * cr - cy * sp * sr,
            cy * cp * cr + sy * sp * sr,
        ]
    )
    zero, one = np.zeros_like(yaw[0]), np.ones_like(yaw[0])
    yaw_axis = np.array([zero, zero, one])
    pitch_axis = np.array([-np.sin(yaw[0]), np.cos(yaw[0]), zero])
    roll_axis = np.array(
        [np.cos(yaw[0]) * np.cos(pitch[0]), np.sin(yaw[0]) * np.cos(pitch[0]), -np.sin(pitch[0])]
    )
    after_yaw = yaw[1] * yaw_axis
    after_pitch = after_yaw + pitch[1] * pitch_axis
    omega = after_pitch + roll[1] * roll_axis
    alpha = (
        yaw[2] * yaw_axis
        + pitch[2] * pitch_axis
        + pitch[1] * np.cross(after_yaw, pitch_axis, axis=0)
        + roll[2] * roll_axis
        + roll[1] * np.cross(after_pitch, roll_axis, axis=0)
    )
    return quaternion, omega, alpha


def pose_columns(link: str, position: Array, rotation: tuple[Array, Array, Array]) -> Columns:
    """Name the columns of a pose with its rates.

    Args:
        link: `<link>` or `<link>@<other>`.
        position: Value, rate, acceleration of x, y, z, shape (3, 3, samples) with the coordinate first.
        rotation: What `rotation_motion` gives.

    Returns:
        Nineteen columns.
    """
    quaternion, omega, alpha = rotation
    columns = {f"{link}/pose/{c}": position[i, 0] for i, c in enumerate("xyz")}
    columns |= {f"{link}/pose/{c}": quaternion[i] for i, c in enumerate(("qx", "qy", "qz", "qw"))}
    for order, what, turning in ((1, "velocity", omega), (2, "acceleration", alpha)):
        columns |= {f"{link}/{what}/{c}": position[i, order] for i, c in enumerate("xyz")}
        columns |= {f"{link}/{what}/{c}": turning[i] for i, c in enumerate(("wx", "wy", "wz"))}
    return columns


def platform_columns(
    time: Array, link: str, first: int, home: Triple, reach: Triple, tilt: Triple
) -> Columns:
    """Move a platform with six freedoms about its home.

    Args:
        time: Shape (samples,), [s].
        link: `<link>@<other>`.
        first: Number of its first coordinate.
        home: Position at home [m].
        reach: Amplitudes of x, y, z [m].
        tilt: Amplitudes of roll, pitch, yaw [rad].

    Returns:
        Nineteen columns.
    """
    position = np.array([wave(time, first + i, reach[i], home[i]) for i in range(3)])
    angles = (wave(time, first + 3 + i, tilt[i]) for i in range(3))
    return pose_columns(link, position, rotation_motion(*angles))


def gough_stewart(time: Array) -> Columns:
    """Move the platform in all six freedoms."""
    home, reach, tilt = (0.0, 0.0, 0.7), (0.08, 0.08, 0.06), (0.2, 0.2, 0.25)
    return platform_columns(time, "m1_platform@m1_base", 0, home, reach, tilt)


def lx4(time: Array) -> Columns:
    """Move each of the four platforms relative to the one below."""
    columns: Columns = {}
    for k in range(1, 5):
        below, height = ("m1_base", 0.5) if k == 1 else (f"m{k - 1}_platform", 0.525)
        home, reach, tilt = (0.0, 0.0, height), (0.04, 0.04, 0.04), (0.14, 0.14, 0.14)
        columns |= platform_columns(time, f"m{k}_platform@{below}", 6 * (k - 1), home, reach, tilt)
    return columns


def rps3(time: Array) -> Columns:
    """Give height, roll and pitch only, without rates: the reader's spline and the loops supply the rest."""
    platform = "m1_platform@m1_base/pose"
    return {
        f"{platform}/z": wave(time, 0, 0.06, 0.5)[0],
        f"{platform}/roll": wave(time, 1, 0.2)[0],
        f"{platform}/pitch": wave(time, 2, 0.2)[0],
    }


def five_bar(time: Array) -> Columns:
    """Move the two motors."""
    left, right = wave(time, 0, 0.4), wave(time, 1, 0.4)
    return joint_columns("m1_left_drive", left) | joint_columns("m1_right_drive", right)


def delta_columns(time: Array, base: str, first: int, home: Triple, reach: Triple) -> Columns:
    """Move the platform of a Delta, which only translates, relative to the link that carries the Delta."""
    columns: Columns = {}
    for i, axis in enumerate("xyz"):
        motion = wave(time, first + i, reach[i], home[i])
        for order, what in enumerate(("pose", "velocity", "acceleration")):
            columns[f"m1_platform@{base}/{what}/{axis}"] = motion[order]
    return columns


def delta(time: Array) -> Columns:
    """Move the platform briskly, as a Delta does."""
    return delta_columns(time, "m1_base", 0, (0.0, 0.0, -0.65), (0.16, 0.16, 0.09))


def tanev(time: Array) -> Columns:
    """Move the motors of the 3-RPS, and turn the upper platform about its ball."""
    columns: Columns = {}
    for i in range(3):
        columns |= joint_columns(f"m1_leg{i + 1}_slide", wave(time, i, 0.06))
    angles = [wave(time, 3 + i, amplitude) for i, amplitude in enumerate((0.25, 0.25, 0.2))]
    rotation = rotation_motion(*angles)
    (roll, pitch, yaw), (_, omega, alpha) = (angle[0] for angle in angles), rotation
    pivot, above = np.array([0.0, 0.0, 0.345]), 0.04  # the ball in m1_platform; the platform's origin over it
    arm = above * np.array(
        [
            np.cos(yaw) * np.sin(pitch) * np.cos(roll) + np.sin(yaw) * np.sin(roll),
            np.sin(yaw) * np.sin(pitch) * np.cos(roll) - np.cos(yaw) * np.sin(roll),
            np.cos(pitch) * np.cos(roll),
        ]
    )
    velocity = np.cross(omega, arm, axis=0)
    acceleration = np.cross(alpha, arm, axis=0) + np.cross(omega, velocity, axis=0)
    position = np.stack([pivot[:, None] + arm, velocity, acceleration], axis=1)
    return columns | pose_columns("m2_platform@m1_platform", position, rotation)


def stewart_ur5(time: Array) -> Columns:
    """Move the platform and, about a bent posture, the six joints of the arm."""
    home, reach, tilt = (0.0, 0.0, 0.7), (0.06, 0.06, 0.05), (0.12, 0.12, 0.2)
    columns = platform_columns(time, "m1_platform@m1_base", 0, home, reach, tilt)
    bent = {
        "shoulder_pan_joint": 0.0,
        "shoulder_lift_joint": -1.3,
        "elbow_joint": 1.6,
        "wrist_1_joint": -1.9,
        "wrist_2_joint": -1.6,
        "wrist_3_joint": 0.0,
    }
    for number, (joint, angle) in enumerate(bent.items(), start=6):
        columns |= joint_columns(joint, wave(time, number, 0.5, angle))
    return columns


def scara_delta(time: Array) -> Columns:
    """Move the four joints of the arm, and the Delta relative to the arm's flange."""
    arm = {
        "scara_shoulder": (-0.5, 0.6),
        "scara_elbow": (1.0, 0.7),
        "scara_lift": (0.0, 0.1),
        "scara_spin": (0.0, 0.8),
    }
    columns: Columns = {}
    for number, (joint, (middle, amplitude)) in enumerate(arm.items()):
        columns |= joint_columns(joint, wave(time, number, amplitude, middle))
    return columns | delta_columns(time, "scara_flange", 4, (0.0, 0.0, -0.29), (0.05, 0.05, 0.03))


def snake(time: Array) -> Columns:
    """Send a wave along the motors of the twelve modules; the tail's pose is for base="moving"."""
    position = np.array([wave(time, i, reach, middle) for i, (reach, middle) in enumerate(TAIL_REACH)])
    angles = (wave(time, 3 + i, tilt, middle) for i, (tilt, middle) in enumerate(TAIL_TILT))
    columns = pose_columns("tail", position, rotation_motion(*angles))
    for k in range(12):
        lag = 2.0 * np.pi * k / 9.0
        for i in range(3):
            foot = 2.0 * np.pi * i / 3.0
            motion = np.cos(foot) * sinusoid(time, 1, -lag, 0.008)
            motion += np.sin(foot) * sinusoid(time, 2, -lag, 0.004) + sinusoid(time, 3, -lag, 0.001)
            columns |= joint_columns(f"m{k + 1}_leg{i + 1}_slide", motion)
    return columns


# The snake hangs: its tail's z axis, along which the modules stack, points down.
TAIL_REACH = ((0.1, 0.0), (0.05, 0.0), (0.03, 2.0))  # amplitude and middle of x, y, z [m]
TAIL_TILT = ((0.1, 0.0), (0.1, np.pi), (0.3, 0.0))  # of roll, pitch, yaw [rad]

# Name of the robot: period [s] and motion.
MOTIONS: dict[str, tuple[float, Callable[[Array], Columns]]] = {
    "gough_stewart": (3.0, gough_stewart),
    "lx4": (5.0, lx4),
    "rps3": (2.5, rps3),
    "five_bar": (2.0, five_bar),
    "delta": (1.5, delta),
    "tanev": (3.0, tanev),
    "stewart_ur5": (5.0, stewart_ur5),
    "scara_delta": (3.0, scara_delta),
    "snake": (4.0, snake),
}


def table(time: Array, columns: Columns) -> str:
    """Write `time` and the columns as comma-separated text."""
    columns = {"time": time} | columns
    digits = [JOINT_DIGITS if name.count("/") < 2 else POSE_DIGITS for name in columns]
    values = np.column_stack(list(columns.values())) + 0.0  # no negative zeros
    rows = (",".join(map("{:.{}g}".format, row, digits)) for row in values.tolist())
    return "\n".join([",".join(columns), *rows]) + "\n"


def main(names: list[str]) -> None:
    """Write the tables of the named robots, or of all."""
    here = Path(__file__).parent
    for name in names or MOTIONS:
        period, motion = MOTIONS[name]
        time = np.linspace(0.0, period, SAMPLES)
        (here / name / "traj.csv").write_text(table(time, motion(time)), encoding="utf-8", newline="\n")


if __name__ == "__main__":
    main(sys.argv[1:])
