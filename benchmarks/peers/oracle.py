"""The dense null-space `tests.oracle`: maximal coordinates, singular values, double precision."""

from __future__ import annotations

from collections.abc import Callable

from benchmarks.methods import Method, Setting, Solver
from hybridyn import HybridRobot
from tests.oracle import Oracle

#: Velocities: beyond, seconds per sample.
MOST = 400


def ddm(robot: HybridRobot) -> Callable[[Setting], Solver]:
    """Prepare the direct model."""
    oracle = Oracle(robot.description, robot.base)
    return lambda setting: oracle.ddm


def idm(robot: HybridRobot) -> Callable[[Setting], Solver]:
    """Prepare the inverse model."""
    oracle = Oracle(robot.description, robot.base)
    return lambda setting: oracle.idm


METHODS = (
    Method("dense null space", "ddm", ddm, most=MOST),
    Method("dense null space", "idm", idm, most=MOST),
)
