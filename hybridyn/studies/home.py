"""Find home postures: the postures that close every loop with the motors at given positions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..description.names import did_you_mean
from ..description.records import ZERO
from ..errors import ModelError
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

    Args:
        motors: Positions of motors [m or rad]; motors left out stay at home.
        starts: Number of random starts per module with loops.
        seed: Seed of the starts.

    Raises:
        ModelError: A name is no motor.
        AssemblyError: No posture closes the loops, or the motors do not determine it.
    """
    given = dict(motors or {})
    for name in given:
        if name not in robot.motors:
            raise ModelError(f"no such motor '{name}'{did_you_mean(name, robot.motors)}", element=name)
    home = {name: values[0] for name, values in positions(robot, robot.home).items() if name in robot.motors}
    from .assemblies import assemblies  # not needed to name the branch, as most commands do

    found = assemblies(robot, motors={**home, **given}, starts=starts, seed=seed)
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
    zero = np.concatenate([ZERO[kind] for kind in robot.kinds])
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
        if kinds[name] == "spherical":
            out[name] = 2 * float(np.arccos(min(1.0, abs(float(a @ b)))))
        elif kinds[name] == "continuous":
            out[name] = abs(float(np.angle(np.exp(1j * (a[0] - b[0])))))
        else:
            out[name] = float(np.abs(a - b).max())
    return out
