"""Evaluate designs: from values of the parameters to one row per design, whatever goes wrong with it."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from ...effects import choose
from ...errors import HybridynError
from ...spatial import Array
from ...structure.robot import HybridRobot
from ...threads import one_thread
from ..workspace.workspace import workspace
from .following import Follower, Postmortem, Track, follow
from .measures import OF_WORKSPACE, Gauge, call, functions_of
from .playing import Player
from .study_file import StudyFile
from .study_tables import TaskTable
from .variants import Variants

#: What may happen to a design.
STATUSES = ("ok", "unreachable", "singular", "not loaded", "failed")
#: Characters of a message that are kept in the table.
MESSAGE = 300


@dataclass(frozen=True)
class Row:
    """One design.

    Attributes:
        design: Its number, from 0.
        values: Values of the parameters, shape (parameters,).
        status: One of `STATUSES`.
        unreachable: Number of postures whose loops do not close.
        singular: Number of postures at which a matrix loses rank.
        measures: What was measured, in the order of the study's columns; nan where the design is not "ok".
        message: The first error, or "".
    """

    design: int
    values: tuple[float, ...]
    status: str
    unreachable: int
    singular: int
    measures: tuple[float, ...]
    message: str


@dataclass(frozen=True, eq=False)
class Chunk:
    """Consecutive designs, evaluated in one go by one process.

    Attributes:
        start: Number of the first design.
        values: Values of the parameters, shape (designs, parameters).
    """

    start: int
    values: Array

    @property
    def stop(self) -> int:
        """Number after that of the last design."""
        return self.start + len(self.values)


@dataclass(frozen=True)
class Evaluated:
    """The rows of a chunk.

    Attributes:
        seconds: Time that they took [s].
        compiled: Number of rows from compiled models.
        checked: Number of those that were compared with robots built for their designs.
        difference: Largest relative difference found.
    """

    rows: tuple[Row, ...]
    seconds: float
    compiled: int = 0
    checked: int = 0
    difference: float = 0.0


@one_thread()
def evaluate(source: StudyFile, chunk: Chunk) -> Evaluated:
    """Evaluate the designs of a chunk. Nothing of a design depends on those before it.

    Raises:
        ModelError: A Python file of the study fails.
    """
    started = time.perf_counter()
    designer = Designer(source)
    with np.errstate(all="ignore"):  # overflow shows in the results
        rows = tuple(designer(chunk.start + i, values) for i, values in enumerate(chunk.values))
    return Evaluated(rows, time.perf_counter() - started)


class Designer:
    """Evaluates single designs; holds what they share: tables, functions, the last description."""

    def __init__(self, source: StudyFile) -> None:
        self.source, self.variants = source, Variants(source)
        self.functions = functions_of(source)
        self.tracks = {
            name: Track(source.beside(task.trajectory))
            for name, task in source.study.tasks.items()
            if task.trajectory is not None
        }
        scenes = [name for name, task in source.study.tasks.items() if task.scene is not None]
        self.players = {name: Player(source, name) for name in scenes}

    def __call__(self, design: int, values: Array) -> Row:
        """Evaluate a design.

        Args:
            values: Values of the parameters, shape (parameters,).
        """
        row = partial(Row, design, tuple(values.tolist()))
        nothing = (math.nan,) * len(self.source.columns)
        try:
            robot = self.variants(self.variants.named(values))
        except Exception as error:
            return row("not loaded", 0, 0, nothing, said(error))
        try:
            found, measures = self._tasks(robot)
        except Exception as error:
            return row("failed", 0, 0, nothing, said(error))
        good = found.status == "ok"
        return row(
            found.status, found.unreachable, found.singular, measures if good else nothing,
            found.message[:MESSAGE],
        )  # fmt: skip

    def _tasks(self, robot: HybridRobot) -> tuple[Postmortem, tuple[float, ...]]:
        """Run every task; errors are those of the first that fails, counts those of all."""
        whole = Postmortem()
        measures: dict[str, float] = {}
        for name, task in self.source.study.tasks.items():
            found, values = self._task(robot, name, task)
            whole.unreachable += found.unreachable
            whole.singular += found.singular
            if found.status != "ok":
                whole.add(found.status, found.message)
            measures |= {self.source.column(name, key): value for key, value in values.items()}
        return whole, tuple(measures.get(column, math.nan) for column in self.source.columns)

    def _task(self, robot: HybridRobot, name: str, task: TaskTable) -> tuple[Postmortem, dict[str, float]]:
        if task.workspace is not None:
            return Postmortem(), _in_workspace(robot, task, self.functions)
        if task.scene is not None:
            return self.players[name](robot, self.functions)
        chosen = choose(robot, task.effects)
        chosen = chosen.only([effect for effect in chosen.names if effect != "limits"])  # margins say it
        gauge = Gauge(robot, task.wanted, self.functions)
        found = follow(robot, self.tracks[name], Follower(task.passive, chosen), gauge.add)
        return found, gauge.values() if found.status == "ok" else {}


def _in_workspace(
    robot: HybridRobot, task: TaskTable, functions: Mapping[str, Callable[..., Any]]
) -> dict[str, float]:
    """Measure the workspace of a design."""
    stated = task.workspace
    assert stated is not None
    found = workspace(
        robot,
        stated.module,
        link=stated.link,
        axes=stated.axes,
        at=stated.at,
        steps=stated.steps,
        limits=stated.limits,
    )
    return {
        name: OF_WORKSPACE[word](found) if word in OF_WORKSPACE else call(functions, word, robot, found)
        for name, word in task.wanted.items()
    }


def said(error: Exception) -> str:
    """Return an error as the message of a row, one line."""
    text = str(error) if isinstance(error, HybridynError) else f"{type(error).__name__}: {error}"
    return " ".join(text.split())[:MESSAGE]
