"""`hybridyn.idm` and `ddm`: of calls for single samples in a loop, CasADi takes those from the hundredth on.

The written equations give a sample in a tenth or less of the general path's time, and agree with it as
compiled models do. The general path computes what they hand over, and raises its errors. Programs whose calls
stay with it are advised to compile.
"""

from __future__ import annotations

import itertools
import logging
import os
import warnings
from collections import Counter
from collections.abc import Callable
from functools import lru_cache, wraps
from inspect import signature
from threading import Lock
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numpy as np

from ..dynamics import direct, inverse
from ..effects.choice import Choice
from ..errors import HybridynError, PerformanceWarning
from ..structure.robot import HybridRobot

if TYPE_CHECKING:
    from .model import CompiledRobot

log = logging.getLogger("hybridyn.compiled")

#: Environment variable that leaves all calls to the general path where it is "general".
VARIABLE = "HYBRIDYN_SINGLE_CALLS"
#: Call of a model for a single sample from which CasADi computes: those before take the general path about as
#: long as writing the equations.
MANY = 100
#: Calls for a single sample on the general path after which a program is advised to compile, once in a
#: process: a few seconds of computing.
MANY_CALLS = 1000
#: Most robots, each with a choice of effects, that are kept.
MOST = 8

Model = TypeVar("Model", bound=Callable[..., Any])

_general_calls = itertools.count(1)


class RepeatedCalls:
    """The calls for single samples of one robot with a choice of effects."""

    def __init__(self, robot: HybridRobot, effects: Choice) -> None:
        self._robot, self._effects = robot, effects
        self._counts: Counter[str] = Counter()
        self._models: dict[str, CompiledRobot | None] = {}
        self._alone = Lock()

    def model(self, name: str) -> CompiledRobot | None:
        """Count a call of a model; return what computes it, or None for the general path."""
        if name in self._models:
            return self._models[name]
        self._counts[name] += 1
        if self._counts[name] < MANY:
            return None
        with self._alone:
            if name not in self._models:
                self._models[name] = self._written(name)
        return self._models[name]

    def _written(self, name: str) -> CompiledRobot | None:
        """Write a model; None where that is not possible: the general path goes on."""
        from .compiling import interpreted_model

        try:
            return interpreted_model(self._robot, self._effects, name)
        except HybridynError as error:
            log.info("robot '%s': the general path computes '%s': %s", self._robot.name, name, error)
            return None


@lru_cache(MOST)
def _calls_of(robot: HybridRobot, effects: Choice) -> RepeatedCalls:
    """Return the calls of a robot, itself, and of effects that can be compared: chosen ones, and words."""
    return RepeatedCalls(robot, effects)


def _is_single(q: object) -> bool:
    """Return whether positions are those of a single sample."""
    try:
        return np.ndim(q) == 1  # type: ignore[arg-type]
    except ValueError:  # rows of different lengths
        return False


def _model_of(robot: HybridRobot, effects: Choice, name: str) -> CompiledRobot | None:
    """Count a call of a model; return what computes it, or None for the general path."""
    if os.environ.get(VARIABLE) == "general":
        return None
    same: Any = tuple(effects) if isinstance(effects, list) else effects
    try:
        calls = _calls_of(robot, same)
    except TypeError:  # effects with numbers by name
        return None
    return calls.model(name)


def repeated(general: Model) -> Model:
    """Let CasADi compute a model of the general path that is called often for single samples."""
    name, names = general.__name__, list(signature(general).parameters)[:4]

    @wraps(general)
    def call(*given: Any, **options: Any) -> Any:
        """Compute the model."""
        stated = dict(zip(names, given, strict=False)) | options
        robot, effects, single = stated.get("robot"), stated.pop("effects", None), _is_single(stated.get("q"))
        if single and stated.keys() == set(names) and isinstance(robot, HybridRobot):
            model = _model_of(robot, effects, name)
            if model is not None:
                return getattr(model, name)(*(stated[x] for x in names[1:]))
        found = general(*given, **options)
        if single and next(_general_calls) == MANY_CALLS:
            warnings.warn(
                f"{MANY_CALLS:,} calls for a single sample: hybridyn.compile(robot) gives a model whose idm "
                "and ddm take microseconds a call, a thousandth of this; or pass all samples in one call",
                PerformanceWarning,
                stacklevel=2,
            )
        return found

    return cast(Model, call)


idm, ddm = repeated(inverse.idm), repeated(direct.ddm)
