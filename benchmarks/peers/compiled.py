"""hybridyn's compiled path: `hybridyn.compile(robot)`, straight-line C for one robot."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import hybridyn
from benchmarks.methods import Method, NotMeasuredError, Setting, Solver
from hybridyn import HybridRobot, HybridynError

NAME = "hybridyn, compiled"


def compiled(robot: HybridRobot, threads: int = 1) -> Any:
    """Compile a robot.

    Raises:
        NotMeasuredError: This version does not compile, no C compiler is here, or this robot is refused.
    """
    build = getattr(hybridyn, "compile", None)
    if build is None:
        raise NotMeasuredError("this version of hybridyn does not compile models")
    try:
        return build(robot, threads=threads)
    except (HybridynError, ImportError, NotImplementedError) as error:
        raise NotMeasuredError(f"hybridyn.compile: {str(error).splitlines()[0]}") from None


def ddm(robot: HybridRobot, threads: int = 1) -> Callable[[Setting], Solver]:
    """Prepare the direct model."""
    model = compiled(robot, threads)
    return lambda setting: lambda q, v, tau: model.ddm(q, v, tau)


def idm(robot: HybridRobot, threads: int = 1) -> Callable[[Setting], Solver]:
    """Prepare the inverse model."""
    model = compiled(robot, threads)
    return lambda setting: lambda q, v, a: model.idm(q, v, a)


METHODS = (
    Method(NAME, "ddm", ddm, batches=True, threads=True),
    Method(NAME, "idm", idm, batches=True, threads=True),
)
