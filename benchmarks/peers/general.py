"""hybridyn's general path: Pinocchio per module, NumPy over the batch."""

from __future__ import annotations

from collections.abc import Callable

import hybridyn
from benchmarks.methods import Method, Setting, Solver
from hybridyn import HybridRobot

NAME = "hybridyn, general"


def ddm(robot: HybridRobot) -> Callable[[Setting], Solver]:
    """Prepare the direct model."""
    return lambda setting: lambda q, v, tau: hybridyn.ddm(robot, q, v, tau)


def idm(robot: HybridRobot) -> Callable[[Setting], Solver]:
    """Prepare the inverse model."""
    return lambda setting: lambda q, v, a: hybridyn.idm(robot, q, v, a)


METHODS = (Method(NAME, "ddm", ddm, batches=True), Method(NAME, "idm", idm, batches=True))
