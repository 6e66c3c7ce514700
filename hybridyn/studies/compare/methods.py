"""One interface for whatever computes a model, here or in an engine: set up for a robot, called at a setting.

`hybridyn cost` and the benchmarks sweep the settings.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from typing import Any, Literal, NamedTuple, get_args

import numpy as np

from ...description.names import did_you_mean, listed
from ...errors import ModelError
from ...extensions import Extension, added, every_name
from ...spatial import Array, Index
from ...structure.robot import HybridRobot
from .peer_engine import NotComparableError

#: Models that the benchmarks compare.
Model = Literal["ddm", "idm"]
MODELS: tuple[Model, ...] = get_args(Model)
#: Engines: the extra that installs them.
ENGINES = {"pinocchio": "", "mujoco": "mjcf"}
Setting = Mapping[str, float]

#: Positions, rates, and accelerations or efforts of some samples.
State = tuple[Array, Array, Array]
#: (q, v, tau) -> a for a direct model, (q, v, a) -> tau for an inverse one: one sample (n,), or (T, n).
Solver = Callable[[Array, Array, Array], Array]


@dataclass(frozen=True)
class Method:
    """Something that computes a model of a robot.

    Attributes:
        name: Its name in tables and figures.
        model: Which model: "ddm", "idm" or another quantity.
        setup: Prepares a robot and gives the solver at a setting; what it prepares is shared by settings.
            Raises `NotComparableError`.
        settings: The settings that are swept.
        batches: True where one call takes many samples, (T, n); others are called in a loop.
        threads: True where `setup` takes a number of threads, `setup(robot, threads=2)`.
        most: Most velocities of a robot for which it is tried.
        beyond: What it takes beyond.
        limit: Largest error of one of hybridyn's own methods; beyond, nothing is timed.
    """

    name: str
    model: str
    setup: Callable[..., Callable[[Setting], Solver]]
    settings: tuple[Setting, ...] = ({},)
    batches: bool = False
    threads: bool = False
    most: float = math.inf
    beyond: str = "gigabytes, or seconds a call"
    limit: float = 1e-10

    def prepare(self, robot: HybridRobot, threads: int = 1) -> Callable[[Setting], Solver]:
        """Set up the method for a robot.

        Raises:
            NotComparableError: It cannot do this robot, or is not here.
        """
        self.check_size(robot.nv)
        return self.setup(robot, threads=threads) if self.threads else self.setup(robot)

    def check_size(self, nv: int) -> None:
        """Refuse a robot that is too large.

        Raises:
            NotComparableError: It has too many velocities.
        """
        if nv > self.most:
            raise NotComparableError(f"not tried above {self.most:,.0f} velocities: {self.beyond}")


def written(setting: Setting) -> str:
    """Write a setting in one line, empty for none."""
    return ", ".join(f"{name} {value:g}" for name, value in setting.items())


def grid(**values: tuple[float, ...]) -> tuple[Setting, ...]:
    """Return all combinations of some settings, the last varying fastest."""
    out: list[dict[str, float]] = [{}]
    for name, each in values.items():
        out = [{**one, name: value} for one in out for value in each]
    return tuple(out)


class TimedCall(NamedTuple):
    """What is timed.

    Attributes:
        setting: The setting.
        solve: The solver.
        single: Whether it computes one sample at a time, of those that are judged.
        samples: Number of samples that the call computes.
        call: Computes them.
    """

    setting: Setting
    solve: Solver
    single: bool
    samples: int
    call: Callable[[], object]


def swept(
    method: Method, robot: HybridRobot, states: State, rows: Index, sizes: Sequence[int] = (1,),
    threads: int = 1,
) -> Iterator[TimedCall]:  # fmt: skip
    """Yield the calls of a method at each of its settings.

    Args:
        states: The samples, arrays (T, n).
        rows: Those that calls for one sample take, one after the other.
        sizes: Numbers of samples; the first ones of `states` where it is not 1. A method without batches
            takes them one after the other.
        threads: Number of threads.

    Raises:
        NotComparableError: The method cannot do this robot.
    """
    at = method.prepare(robot, threads)
    for setting in method.settings:
        solve = at(setting)
        for size in sizes:
            batch = [np.ascontiguousarray(x[rows] if size == 1 else x[:size]) for x in states]
            call: Callable[[], object] = partial(solve, *batch)
            if size == 1 or not method.batches:
                call = partial(each, solve, [*zip(*batch, strict=True)])
            yield TimedCall(setting, solve, size == 1, len(batch[0]), call)


def each(solve: Solver, samples: Sequence[State]) -> list[Array]:
    """Compute sample after sample, and keep what is found, as who needs many must."""
    return [solve(*sample) for sample in samples]


def engine_names(asked: Iterable[str] | None = None) -> tuple[str, ...]:
    """Return the names of all engines; if those that are asked for are hybridyn's own, only these.

    Raises:
        ModelError: Two packages add engines of one name.
    """
    return every_name("engines", asked)


def checked_engine(found: Extension) -> Any:
    """Return the module of an engine that a package adds.

    Raises:
        ModelError: It has no `ways`, no `METHODS`, or no `__version__`.
    """
    lacking = [name for name in ("ways", "METHODS", "__version__") if not hasattr(found.value, name)]
    if lacking:
        raise found.refused("engines", f"has no {' and no '.join(lacking)}")
    if not all(isinstance(method, Method) for method in found.value.METHODS):
        raise found.refused("engines", "has METHODS that are not of hybridyn.studies.compare.methods.Method")
    return found.value


def engine_file(engine: str) -> Any:
    """Return the module of an engine: its `ways` for a robot, and its `METHODS`.

    Raises:
        ModelError: The engine is unknown.
    """
    if (found := added("engines", engine)) is not None:
        return found
    if engine not in ENGINES:
        known = engine_names()
        raise ModelError(
            f"there is no engine '{engine}'{did_you_mean(engine, known)}; known: {listed(known)}"
        )
    return import_module(f"{__package__}.engines.{engine}_engine")


def methods_of(engine: str, model: str) -> list[Method]:
    """Return what an engine has for a model.

    Raises:
        ModelError: The engine is unknown.
    """
    return [method for method in engine_file(engine).METHODS if method.model == model]
