"""hybridyn's own: the general path, compiled models in double and in single precision, and the oracle."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import hybridyn
from hybridyn import HybridRobot, HybridynError
from hybridyn.dynamics import direct, inverse
from hybridyn.studies.compare.methods import MODELS, Method, Model, Setting, Solver
from hybridyn.studies.compare.peer_engine import NotComparableError
from tests.oracle import Oracle

GENERAL, COMPILED = "hybridyn, general", "hybridyn, compiled"
SINGLE, ORACLE = f"{COMPILED}, float32", "dense null space"
#: Velocities: 64 stacked modules compile in a minute, and as long again for four times as many.
MOST = 1_600
#: Velocities of the oracle: beyond, seconds per sample.
MOST_DENSE = 400
#: Seven digits, less what a stack of 16 modules loses.
SINGLE_LIMIT = 1e-2


def general(model: Model, robot: HybridRobot) -> Callable[[Setting], Solver]:
    """Prepare the general path: Pinocchio per module, NumPy over the batch."""
    path: Any = {"idm": inverse.idm, "ddm": direct.ddm}[model]  # single calls of `hybridyn.idm` are CasADi's
    return lambda setting: partial(path, robot)


def compiled(robot: HybridRobot, threads: int = 1, dtype: str = "float64") -> Any:
    """Compile a robot.

    Raises:
        NotComparableError: No C compiler is here, or this robot is refused.
    """
    try:
        return hybridyn.compile(robot, threads=threads, dtype=dtype, wait=True)
    except (HybridynError, ImportError) as error:
        raise NotComparableError(f"hybridyn.compile: {str(error).splitlines()[0]}") from None


def in_c(model: Model, dtype: str, robot: HybridRobot, threads: int = 1) -> Callable[[Setting], Solver]:
    """Prepare a compiled model."""
    own = compiled(robot, threads, dtype)
    return lambda setting: getattr(own, model)


def dense(model: Model, robot: HybridRobot) -> Callable[[Setting], Solver]:
    """Prepare the oracle: maximal coordinates, singular values, double precision."""
    oracle = Oracle(robot.description, robot.base)
    return lambda setting: getattr(oracle, model)


_C = partial(Method, batches=True, threads=True, most=MOST, beyond="minutes of compilation")
METHODS = tuple(
    method
    for model in MODELS
    for method in (
        Method(GENERAL, model, partial(general, model), batches=True),
        _C(COMPILED, model, partial(in_c, model, "float64")),
        _C(SINGLE, model, partial(in_c, model, "float32"), limit=SINGLE_LIMIT),
        Method(ORACLE, model, partial(dense, model), most=MOST_DENSE),
    )
)
