"""The dense null-space `hybridyn.oracle`: maximal coordinates, singular values, double precision."""

from __future__ import annotations

from collections.abc import Callable

from benchmarks.methods import Method, NotMeasuredError, Setting, Solver
from hybridyn import HybridRobot
from hybridyn.oracle import Oracle

MOST = 400  # velocities: beyond, seconds per sample


def prepared(robot: HybridRobot) -> Oracle:
    """Prepare the oracle.

    Raises:
        NotMeasuredError: The robot is too large.
    """
    if robot.nv > MOST:
        raise NotMeasuredError("dense matrices of the whole robot take seconds per sample")
    return Oracle(robot.description, robot.base)


def ddm(robot: HybridRobot) -> Callable[[Setting], Solver]:
    """Prepare the direct model."""
    oracle = prepared(robot)
    return lambda setting: oracle.ddm


def idm(robot: HybridRobot) -> Callable[[Setting], Solver]:
    """Prepare the inverse model."""
    oracle = prepared(robot)
    return lambda setting: oracle.idm


METHODS = (Method("dense null space", "ddm", ddm), Method("dense null space", "idm", idm))
