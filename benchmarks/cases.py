"""What is measured: the shipped robots, stacks of 6-UPS modules, snakes, a serial arm; and their motions."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from importlib.metadata import PackageNotFoundError, files
from pathlib import Path
from typing import NamedTuple

import numpy as np

import hybridyn
from hybridyn.spatial import Array
from hybridyn.studies.compare.peer_engine import NotComparableError

States = tuple[Array, Array, Array]

ROOT = Path(__file__).parents[1]
LX4 = ROOT / "urdf" / "lx4.urdf.xacro"
LX4_TRAJECTORY = ROOT / "models" / "lx4" / "traj.csv"

DOWNWARD, UPWARD = (0.0, 0.0, -9.81), (0.0, 0.0, 9.81)  # gravity, of a robot that stands, that hangs
#: Of a platform above the joints of the one below [m].
HOME_HEIGHT = 0.5
#: From a platform's frame to the joints of the module that it carries [m].
PLATE = 0.025
#: Between samples, as in the shipped trajectories [s].
STEP = 0.005
#: Of each coordinate of a platform [m].
AMPLITUDE = 0.03
#: Of a platform about its axis [rad].
TURN = 0.15
#: Of a motor [m, rad].
SWING = {"prismatic": 0.02, "revolute": 0.1, "continuous": 0.1}
#: Of a snake's motor [m].
SNAKE_SLIDE = 0.005
#: Phases that never coincide.
GOLDEN_ANGLE = np.pi * (3.0 - np.sqrt(5.0))


class Case(NamedTuple):
    """A robot with a motion.

    Attributes:
        load: Gives the robot.
        states: Gives so many states of its motion, q, v, a.
    """

    load: Callable[[], hybridyn.HybridRobot]
    states: Callable[[hybridyn.HybridRobot, int], States]


def case_of(name: str) -> Case:
    """Return a case by name: a shipped robot, "hanging_lx4", "stack 16", "snake 8" or "ur5"."""
    family, _, number = name.partition(" ")
    stacks = {"lx4": partial(stack, 4), "hanging_lx4": partial(stack, 4, gravity=UPWARD)}
    if family == "stack" or name in stacks:
        return Case(stacks.get(name) or partial(stack, int(number)), stack_states)
    slide = SNAKE_SLIDE if family == "snake" else SWING["prismatic"]
    load = partial(snake, int(number)) if number else ur5 if name == "ur5" else partial(shipped, name)
    return Case(load, partial(swinging, slide=slide))


def shipped(name: str) -> hybridyn.HybridRobot:
    """Load a shipped robot on a fixed base."""
    return hybridyn.load(ROOT / "urdf" / f"{name}.urdf.xacro")


def snake(modules: int) -> hybridyn.HybridRobot:
    """Load a snake, its tail held."""
    return hybridyn.load(ROOT / "urdf" / "snake.urdf.xacro", xacro_args={"n": str(modules)})


def ur5() -> hybridyn.HybridRobot:
    """Load a serial arm from example-robot-data.

    Raises:
        NotComparableError: The package is not installed.
    """
    try:
        listed = files("example-robot-data") or []
    except PackageNotFoundError:
        raise NotComparableError("the package example-robot-data is not installed") from None
    return hybridyn.load(Path(str(next(file.locate() for file in listed if file.name == "ur5_robot.urdf"))))


def swinging(robot: hybridyn.HybridRobot, samples: int, slide: float = SWING["prismatic"]) -> States:
    """Swing every motor about home, each with its phase: q, v, a, shapes (T, nq), (T, nv), (T, nv)."""
    motors = {}
    for k, name in enumerate(robot.motors):
        number = robot.joint_index[name]
        kind = robot.kinds[number]
        size = slide if kind == "prismatic" else SWING[kind]
        home = robot.home[robot.q_slices[number]]
        position = np.arctan2(home[1], home[0]) if kind == "continuous" else home[0]
        x, rate, change = size * waves(samples, np.array([GOLDEN_ANGLE * k]))[:, :, 0]
        motors[name] = (position + x, rate, change)
    return hybridyn.assemble(robot, motors=motors, guess=robot.home)


def stack(modules: int, gravity: tuple[float, float, float] = DOWNWARD) -> hybridyn.HybridRobot:
    """Load a stack of equal 6-UPS modules, those of the LX4."""
    return hybridyn.load(LX4, xacro_args={"modules": str(modules)}, gravity=gravity)


def stack_motion(modules: int, samples: int) -> dict[str, tuple[Array, Array, Array]]:
    """Return a smooth motion of every platform relative to the one below, of one second's period.

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
    """Return sin(2 pi t + phase), its rate and acceleration, shape (3, T, phases)."""
    omega = 2.0 * np.pi
    angles = omega * STEP * np.arange(samples)[:, None] + phases
    return np.array([np.sin(angles), omega * np.cos(angles), -(omega**2) * np.sin(angles)])


def stack_states(robot: hybridyn.HybridRobot, samples: int) -> States:
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
