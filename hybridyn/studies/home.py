"""Find home postures: the postures that close every loop with the motors at given positions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..assembly.requests import home_requests
from ..joints.kinds import JointKind
from ..spatial import Array
from ..structure.robot import HybridRobot, positions
from ..tables.signals import unit_of

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
    requests = home_requests(robot, motors)
    from .assemblies import search  # not needed to name the branch, as most commands do

    found = search(robot, requests, starts, seed)
    out = []
    for q, count, residual, within in zip(
        found.q, found.counts, found.residual, found.within_limits, strict=True
    ):
        distances = _distances(robot, q, robot.home)
        distances = dict(sorted(distances.items(), key=lambda item: -round(item[1], TIED)))
        joint, distance = next(iter(distances.items()), ("", 0.0))
        out.append(HomePosture(q, float(residual), bool(within), joint, distance, int(count), distances))
    return Homes(tuple(out), found.unseen)


def branch(robot: HybridRobot) -> list[str]:
    """Return one line that names the assembly branch; none if all joints of the loops are zero at home."""
    far = far_from_zero(robot)
    return [f"assembly branch: that of the home posture, {far}"] if far else []


def far_from_zero(robot: HybridRobot) -> str:
    """Name the joint of a loop that is farthest from zero at home; return "" if all are zero."""
    loops = {closure.name for closure in robot.description.closures}
    looped = {name for module in robot.modules if loops & {*module.closures} for name in module.joints}
    if not looped:
        return ""
    zero = np.concatenate([kind.zero for kind in robot.kinds])
    distances = _distances(robot, robot.home, zero)
    joint = max((name for name in distances if name in looped), key=lambda name: distances[name], default="")
    if not joint or distances[joint] == 0.0:
        return ""
    unit = unit_of(robot.kinds[robot.joint_index[joint]])
    return f"in which '{joint}' is farthest from zero ({distances[joint]:.3g} {unit})"


def _distances(robot: HybridRobot, q: Array, reference: Array) -> dict[str, float]:
    """Return how far each joint of a posture is from another posture [m or rad]."""
    here, home = positions(robot, q), positions(robot, reference)
    kinds = dict(zip(robot.joints, robot.kinds, strict=True))
    out = {}
    for name, values in here.items():
        a, b = np.array(values), np.array(home[name])
        if kinds[name] is JointKind.SPHERICAL:
            out[name] = 2 * float(np.arccos(min(1.0, abs(float(a @ b)))))
        elif kinds[name].endless:
            out[name] = abs(float(np.angle(np.exp(1j * (a[0] - b[0])))))
        else:
            out[name] = float(np.abs(a - b).max())
    return out
