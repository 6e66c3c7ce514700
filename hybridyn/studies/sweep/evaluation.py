"""Evaluate designs: from values of the parameters to one row per design, whatever goes wrong with it.

A trajectory that every design follows is read once, then computed for each robot, block by block.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

from ...effects import Effects, choose
from ...errors import AssemblyError, HybridynError, SingularityError
from ...spatial import Array
from ...streams.postures import TreeSamples
from ...structure.robot import HybridRobot
from ..workspace.workspace import workspace
from .following import Track, follow
from .measures import OF_WORKSPACE, measured
from .playing import Player
from .python_measures import call, functions_of
from .study_file import StudyFile, TaskTable
from .variants import Variants

#: What may happen to a design.
STATUSES = ("ok", "unreachable", "singular", "not loaded", "failed")
#: Characters of a message that are kept in the table.
MESSAGE = 300


@dataclass(frozen=True)
class DesignRow:
    """One design.

    Attributes:
        design: Its number, from 0.
        values: Values of the parameters, shape (parameters,).
        status: One of `STATUSES`: that of the first task with an error.
        measures: What was measured, in the order of the study's columns; nan for a task that met an error.
        message: The first error, or "".
        gradients: What stands in `StudyFile.gradient_columns`, or nothing.
    """

    design: int
    values: tuple[float, ...]
    status: str
    measures: tuple[float, ...]
    message: str
    gradients: tuple[float, ...] = ()


#: The blocks of a trajectory: postures, and efforts of the motors, shape (T, motors).
Motions = list[tuple[TreeSamples, Array]]


class Evaluation(NamedTuple):
    """A design with the robot and the motions that were measured.

    Attributes:
        row: The design.
        robot: Its robot, or None where it does not load.
        motions: Those of each trajectory by task.
    """

    row: DesignRow
    robot: HybridRobot | None
    motions: dict[str, Motions]


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

    rows: tuple[DesignRow, ...]
    seconds: float
    compiled: int = 0
    checked: int = 0
    difference: float = 0.0


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

    def __call__(self, design: int, values: Array) -> DesignRow:
        """Evaluate a design.

        Args:
            values: Values of the parameters, shape (parameters,).
        """
        return self.evaluated(design, values).row

    def evaluated(self, design: int, values: Array) -> Evaluation:
        """Evaluate a design, and return its robot and its motions, too; the arguments are those of a call."""
        row = partial(DesignRow, design, tuple(values.tolist()))
        measures, status, message = dict.fromkeys(self.source.columns, math.nan), "ok", ""
        motions: dict[str, Motions] = {}
        try:
            robot = self.variants(self.variants.named(values))
        except Exception as error:
            return Evaluation(row("not loaded", tuple(measures.values()), said(error)), None, motions)
        for name, task in self.source.study.tasks.items():
            try:
                own = self._task(robot, name, task, motions)
            except Exception as error:
                if status == "ok":
                    status, message = status_of(error), said(error)
            else:
                measures |= {self.source.column(name, key): value for key, value in own.items()}
        return Evaluation(row(status, tuple(measures.values()), message), robot, motions)

    def _task(
        self, robot: HybridRobot, name: str, task: TaskTable, motions: dict[str, Motions]
    ) -> dict[str, float]:
        if task.workspace is not None:
            return _in_workspace(robot, task, self.functions)
        if task.scene is not None:
            return self.players[name](robot, self.functions)
        effects = effects_of(robot, task)
        motions[name] = [*follow(robot, self.tracks[name], task.passive, effects, task.redundancy)]
        return measured(robot, task.wanted, motions[name], self.functions)


def effects_of(robot: HybridRobot, task: TaskTable) -> Effects:
    """Return the effects of a task; limits are none, since margins say more."""
    return choose(robot, task.effects).unbounded


def ends_of(robot: HybridRobot, tasks: Iterable[TaskTable]) -> tuple[tuple[str, str], ...]:
    """Return the joints and limits at which stops of tasks begin, as `Effects.ends`."""
    return tuple(dict.fromkeys(end for task in tasks for end in effects_of(robot, task).ends))


def status_of(error: Exception) -> str:
    """Return the status of a design with an error."""
    if isinstance(error, AssemblyError):
        return "unreachable"
    return "singular" if isinstance(error, SingularityError) else "failed"


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
        redundancy=task.redundancy,
    )
    return {
        name: OF_WORKSPACE[word](found) if word in OF_WORKSPACE else call(functions, word, robot, found)
        for name, word in task.wanted.items()
    }


def said(error: Exception) -> str:
    """Return an error as the message of a row, one line."""
    text = str(error) if isinstance(error, HybridynError) else f"{type(error).__name__}: {error}"
    return " ".join(text.split())[:MESSAGE]
