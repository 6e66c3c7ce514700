"""Find home postures: the postures that close every loop with the motors at given positions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

from ..assembly.requests import home_requests
from ..spatial import Array
from ..structure.robot import HybridRobot
from .assemblies import search
from .branch import distances_from

#: Decimals of a distance that decide which joint is farther; at a tie the joint that stands first is.
TIED = 9


@dataclass(frozen=True, eq=False)
class HomePosture:
    """A closed posture.

    Attributes:
        q: Positions on the spanning tree, shape (nq,).
        residual: Largest closure residual, relative to its module's length.
        within_limits: Whether all joints are within their position limits.
        joint: The joint that is farthest from the present home posture.
        distance: Its distance [m or rad].
        count: Number of random starts that led to the posture.
        distances: Distance of each joint from the present home posture, the farthest first [m or rad].
    """

    q: Array
    residual: float
    within_limits: bool
    joint: str
    distance: float
    count: int
    distances: Mapping[str, float]


class Homes(NamedTuple):
    """Closed postures with the same positions of the motors.

    Attributes:
        postures: The postures, the nearest to the present home posture first.
        unseen: Estimated probability that one more start finds another posture.
    """

    postures: tuple[HomePosture, ...]
    unseen: float


def homes(
    robot: HybridRobot, motors: Mapping[str, float] | None = None, *, starts: int = 200, seed: int = 0
) -> Homes:
    """Find the closed postures of a robot with its motors at given positions.

    Joints that neither the motors nor the closures determine stay at home.

    Args:
        motors: Positions of motors, or of other joints with one freedom [m or rad]; motors left out stay at
            home. In a module of which a joint without a motor is named, only motors stay that the named
            joints leave free.
        starts: Number of random starts per module with loops.
        seed: Seed of the starts.

    Raises:
        TrajectoryError: A name is no joint, or one without a single position.
        AssemblyError: No posture closes the loops.
    """
    found = search(robot, home_requests(robot, motors), starts, seed)
    out = []
    for q, count, residual, within in zip(
        found.q, found.counts, found.residual, found.within_limits, strict=True
    ):
        distances = distances_from(robot, robot.home, q)
        distances = dict(sorted(distances.items(), key=lambda item: -round(item[1], TIED)))
        joint, distance = next(iter(distances.items()), ("", 0.0))
        out.append(HomePosture(q, float(residual), bool(within), joint, distance, int(count), distances))
    return Homes(tuple(out), found.unseen)
