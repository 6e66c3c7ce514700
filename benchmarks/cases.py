"""What is measured: stacks of Gough-Stewart modules, and the LX4's shipped trajectory made longer."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import hybridyn
from hybridyn.spatial import Array

ROOT = Path(__file__).parents[1]
LX4 = ROOT / "urdf" / "lx4.urdf.xacro"
LX4_TRAJECTORY = ROOT / "models" / "lx4" / "traj.csv"

HOME_HEIGHT = 0.5  # of a platform above the joints of the one below [m]
PLATE = 0.025  # from a platform's frame to the joints of the module that it carries [m]
STEP = 0.005  # between samples, as in the shipped trajectories [s]
AMPLITUDE = 0.03  # of each coordinate of a platform [m]
TURN = 0.15  # of a platform about its axis [rad]
GOLDEN_ANGLE = np.pi * (3.0 - np.sqrt(5.0))  # phases that never coincide


def stack(modules: int) -> hybridyn.HybridRobot:
    """Load a stack of equal 6-UPS modules, those of the LX4."""
    return hybridyn.load(LX4, xacro_args={"modules": str(modules)})


def stack_motion(modules: int, samples: int) -> dict[str, tuple[Array, Array, Array]]:
    """Give a smooth motion of every platform relative to the one below, of one second's period.

    Args:
        modules: Number of modules.
        samples: Number of samples T.

    Returns:
        For each platform pose, twist, acceleration, as `assemble` takes them: shapes (T, 7), (T, 6), (T, 6).
    """
    motion = {}
    for k in range(modules):
        home = np.array([0.0, 0.0, HOME_HEIGHT + (PLATE if k else 0.0)])
        x, x_dot, x_ddot = AMPLITUDE * waves(samples, GOLDEN_ANGLE * (4 * k + np.arange(3)))
        angle, rate, change = TURN * waves(samples, np.array([GOLDEN_ANGLE * (4 * k + 3)]))
        axis = np.array([np.cos(k), np.sin(k), 1.0]) / np.sqrt(2.0)
        quaternion = np.hstack([axis * np.sin(angle / 2.0), np.cos(angle / 2.0)])
        below = "m1_base" if k == 0 else f"m{k}_platform"
        motion[f"m{k + 1}_platform@{below}"] = (
            np.hstack([home + x, quaternion]),
            np.hstack([x_dot, axis * rate]),
            np.hstack([x_ddot, axis * change]),
        )
    return motion


def waves(samples: int, phases: Array) -> Array:
    """Give sin(2 pi t + phase), its rate and acceleration, shape (3, T, phases)."""
    omega = 2.0 * np.pi
    angles = omega * STEP * np.arange(samples)[:, None] + phases
    return np.array([np.sin(angles), omega * np.cos(angles), -(omega**2) * np.sin(angles)])


def stack_states(robot: hybridyn.HybridRobot, samples: int) -> tuple[Array, Array, Array]:
    """Assemble that motion: q, v, a, shapes (T, nq), (T, nv), (T, nv)."""
    return hybridyn.assemble(robot, platforms=stack_motion(len(robot.modules), samples))


def write_long_trajectory(path: Path, rows: int) -> None:
    """Write the LX4's periodic trajectory again and again, until it has that many rows."""
    header, *lines = LX4_TRAJECTORY.read_text().splitlines()
    period = float(lines[-1].split(",", 1)[0])
    lines.pop()  # the last row is the first of the next period
    with path.open("w") as file:
        file.write(f"{header}\n")
        for row in range(rows):
            turn, index = divmod(row, len(lines))
            time, rest = lines[index].split(",", 1)
            file.write(f"{float(time) + turn * period:.6f},{rest}\n")
