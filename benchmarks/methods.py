"""One interface for everything that is compared: a method is set up for a robot, then called at a setting."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal, get_args

from hybridyn import HybridRobot
from hybridyn.spatial import Array

Model = Literal["ddm", "idm"]
MODELS: tuple[Model, ...] = get_args(Model)
Setting = Mapping[str, float]

#: (q, v, tau) -> a for a direct model, (q, v, a) -> tau for an inverse one: one sample (n,), or (T, n).
Solver = Callable[[Array, Array, Array], Array]


class NotMeasuredError(Exception):
    """A method cannot do a robot, or its package is absent; the message says which."""


@dataclass(frozen=True)
class Method:
    """Something that computes a model of a robot.

    Attributes:
        name: Its name in tables and figures.
        model: Which model.
        setup: Prepares a robot and gives the solver at a setting; what it prepares is shared by settings.
            Raises `NotMeasuredError`.
        settings: The settings that are swept.
        batches: True where one call takes many samples, (T, n); others are called in a loop.
        threads: True where `setup` takes a number of threads, `setup(robot, threads=2)`.
        most: Most velocities of a robot for which it is tried.
        beyond: What it takes beyond.
        limit: Largest error of one of hybridyn's own methods; beyond, nothing is timed.
    """

    name: str
    model: Model
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
            NotMeasuredError: It cannot do this robot, or is not here.
        """
        self.check_size(robot.nv)
        return self.setup(robot, threads=threads) if self.threads else self.setup(robot)

    def check_size(self, nv: int) -> None:
        """Refuse a robot that is too large.

        Raises:
            NotMeasuredError: It has too many velocities.
        """
        if nv > self.most:
            raise NotMeasuredError(f"not tried above {self.most:,.0f} velocities: {self.beyond}")


def written(setting: Setting) -> str:
    """Write a setting in one line, empty for none."""
    return ", ".join(f"{name} {value:g}" for name, value in setting.items())


def grid(**values: tuple[float, ...]) -> tuple[Setting, ...]:
    """Return all combinations of some settings, the last varying fastest."""
    out: list[dict[str, float]] = [{}]
    for name, each in values.items():
        out = [{**one, name: value} for one in out for value in each]
    return tuple(out)
