"""hybridyn's compiled path: `hybridyn.compile(robot)`, straight-line C for one robot."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import hybridyn
from benchmarks.methods import Method, NotMeasuredError, Setting, Solver
from hybridyn import HybridRobot, HybridynError

NAME = "hybridyn, compiled"
SINGLE = f"{NAME}, float32"
#: Velocities: 64 stacked modules compile in a minute, and as long again for four times as many.
MOST = 1_600
#: Seven digits, less what a stack of 16 modules loses.
SINGLE_LIMIT = 1e-2


def compiled(robot: HybridRobot, threads: int = 1, dtype: str = "float64") -> Any:
    """Compile a robot.

    Raises:
        NotMeasuredError: No C compiler is here, or this robot is refused.
    """
    try:
        return hybridyn.compile(robot, threads=threads, dtype=dtype)
    except (HybridynError, ImportError) as error:
        raise NotMeasuredError(f"hybridyn.compile: {str(error).splitlines()[0]}") from None


def ddm(robot: HybridRobot, threads: int = 1, dtype: str = "float64") -> Callable[[Setting], Solver]:
    """Prepare the direct model."""
    model = compiled(robot, threads, dtype)
    return lambda setting: model.ddm


def idm(robot: HybridRobot, threads: int = 1, dtype: str = "float64") -> Callable[[Setting], Solver]:
    """Prepare the inverse model."""
    model = compiled(robot, threads, dtype)
    return lambda setting: model.idm


double = partial(Method, batches=True, threads=True, most=MOST, beyond="minutes of compilation")
single = partial(double, limit=SINGLE_LIMIT)

METHODS = (
    double(NAME, "ddm", ddm),
    double(NAME, "idm", idm),
    single(SINGLE, "ddm", partial(ddm, dtype="float32")),
    single(SINGLE, "idm", partial(idm, dtype="float32")),
)
