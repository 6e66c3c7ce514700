"""Robots and states that move freely, for the tests of time integration."""

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path

import numpy as np

from hybridyn import load
from hybridyn.effects import BaseMotion
from hybridyn.manifold.manifold import Manifold
from hybridyn.simulation.motion_law import MotionLaw
from hybridyn.simulation.result import SimulationResult
from hybridyn.simulation.system import State, System
from hybridyn.structure.building import build_robot
from hybridyn.structure.robot import HybridRobot
from tests.robots.mechanisms import random_mechanism, random_states
from tests.robots.shipped import shipped
from tests.support.files import save

Swing = tuple[HybridRobot, np.ndarray, np.ndarray]
BITS = ("t", "q", "v", "a", "tau", "kinetic", "potential", "residual", "pivot")


def equal_bits(x: SimulationResult, y: SimulationResult) -> bool:
    """Tell whether two results are the same bit for bit."""
    return all(getattr(x, name).tobytes() == getattr(y, name).tobytes() for name in BITS)


@lru_cache
def swing(name: str) -> Swing:
    """Return a robot with a closed posture and rates: a shipped one, or a random mechanism as 'kind:base'."""
    if ":" in name:
        kind, base = name.split(":")
        description = random_mechanism(0, kind=kind)
        q, v, _ = random_states(description, base, 0, 1)  # type: ignore[arg-type]
        return build_robot(description, base=base), q[0], 0.3 * v[0]  # type: ignore[arg-type]
    robot = build_robot(shipped(name))
    chart = Manifold(robot).chart(robot.home)
    u = np.array([0.8, 0.5]) if name == "five_bar" else 0.3 * np.random.default_rng(0).normal(size=chart.size)
    return robot, robot.home, chart.at_origin(u)


def begin(of: Swing, **acting: object) -> tuple[System, State]:
    """Return the system and the state at time zero."""
    robot, q, v = of
    law = MotionLaw(robot, **acting)  # type: ignore[arg-type]
    return System(Manifold(robot), law), State(0.0, q, v, law.acceleration(0.0, q.copy(), v.copy()))


def still_base(pose: Sequence[float] = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)) -> BaseMotion:
    """Return the motion of a prescribed base that rests."""
    return BaseMotion(np.arange(6.0), np.tile(pose, (6, 1)))


def chain(folder: Path, bodies: str, joints: str, **options: object) -> HybridRobot:
    """Load a robot from the links and joints of a URDF, a link 'base' included."""
    path = save(folder, f'<robot name="robot"><link name="base"/>{bodies}{joints}</robot>', "robot.urdf")
    return load(path, **options)  # type: ignore[arg-type]


def rod(name: str, mass: float, com: str, inertia: tuple[float, float, float]) -> str:
    """Return a link with principal inertia about its centre of mass."""
    xx, yy, zz = inertia
    return (
        f'<link name="{name}"><inertial><origin xyz="{com}"/><mass value="{mass}"/>'
        f'<inertia ixx="{xx}" iyy="{yy}" izz="{zz}" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    )


def hinge(
    name: str, parent: str, child: str, at: str = "0 0 0", kind: str = "revolute", axis: str = "0 1 0"
) -> str:
    """Return a joint without limits that matter."""
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{at}"/><axis xyz="{axis}"/>'
        '<limit lower="-1000" upper="1000" effort="1000" velocity="1000"/></joint>'
    )
