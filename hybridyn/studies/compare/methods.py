"""One interface for whatever computes a model, here or in an engine: set up for a robot, called at a setting.

`hybridyn cost` and the benchmarks sweep the settings.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal, get_args

from ...spatial import Array
from ...structure.robot import HybridRobot
from .engine import NotComparableError

#: Models that the benchmarks compare.
Model = Literal["ddm", "idm"]
MODELS: tuple[Model, ...] = get_args(Model)
Setting = Mapping[str, float]

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
