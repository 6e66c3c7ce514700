"""Evaluate designs: from values of the parameters to one row per design, whatever goes wrong with it.

A trajectory that every design follows is read once, then computed for each robot, block by block.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from ...dynamics.inverse import inverse_model
from ...effects import Effects, choose
from ...errors import AssemblyError, HybridynError, SingularityError
from ...scenes.scene_file import read_scene
from ...scenes.stage import play, stage
from ...simulation.result import SimulationResult
from ...spatial import Array
from ...streams.postures import TreeSamples, postures, rows_named
from ...structure.robot import HybridRobot
from ...tables.columns import ENERGIES, RESIDUAL, Layout, read_layout
from ...tables.opening import open_table
from ...tables.trajectory import TableMotion, read_motions
from ..workspace.workspace import workspace
from .measures import EVENT, OF_SCENE, OF_WORKSPACE, STATISTICS, call, functions_of, measured
from .study_file import StudyFile, TaskTable
from .variants import Variants


@dataclass
class Track:
    """A trajectory's table, and the motions read from it for the last kind of robot.

    Attributes:
        file: The table.
    """

    file: str
    _kept: tuple[object, Layout, list[TableMotion]] | None = field(default=None, repr=False)

    def motions(self, robot: HybridRobot) -> tuple[Layout, list[TableMotion]]:
        """Return the meaning of the columns, and the motion of a robot's joints and platforms in blocks.

        Raises:
            TrajectoryError: The table is wrong, or does not determine the motion of this robot.
        """
        description = robot.description
        key = (
            [(one.name, one.kind, one.parent, one.child) for one in description.joints],
            [one.name for one in description.links], robot.motors, robot.base,
        )  # fmt: skip
        if self._kept is None or self._kept[0] != key:
            with open_table(self.file) as table:
                layout = read_layout(
                    table.columns, description, motors=robot.motors, base=robot.base, file=table.file
                )
                self._kept = key, layout, [*read_motions(table, layout)]
        return self._kept[1:]


def follow(
    robot: HybridRobot, track: Track, passive: str, effects: Effects
) -> Iterator[tuple[TreeSamples, Array]]:
    """Yield the postures of each block of a trajectory, and the efforts of the motors, shape (T, motors).

    Args:
        passive: As in `hybridyn.idm`.
        effects: The effects that are computed.

    Raises:
        HybridynError: The table does not belong to this robot, or the robot cannot make the motion.
    """
    layout, motions = track.motions(robot)
    last: Array | None = None
    for motion in motions:
        guess = last if layout.time is not None and not layout.full_state else None
        block = postures(robot, motion, layout, guess)
        with rows_named(layout, motion):
            found = inverse_model(
                robot, block.q, block.v, block.a, wrenches=motion.wrenches or None, passive=passive,
                effects=effects, time=motion.time,
            )  # fmt: skip
        last = block.q[-1]
        yield block, found.values


class Player:
    """Simulates a scene with the robots of designs, and measures the motion."""

    def __init__(self, study: StudyFile, task: str) -> None:
        """Read the scene.

        Raises:
            ModelError: The scene is wrong.
        """
        self.study, self.task = study, task
        self.stated = study.study.tasks[task]
        self.wanted = self.stated.wanted
        self.source = read_scene(study.beside(self.stated.scene or ""))

    def check(self, *, allow_python: bool) -> None:
        """Check that the scene has the study's robot, the events that are measured, and no Python unasked.

        Args:
            allow_python: Whether its controller may be a Python program.

        Raises:
            ModelError: One of these is wrong.
        """
        scene, keys = self.source.scene, ("tasks", self.task, "scene")
        mine, study = scene.robot, self.study.study.robot
        if Path(self.source.robot).resolve() != Path(self.study.robot).resolve():
            raise self.source.error(("robot", "file"), f"must be the robot of the study, '{study.file}'")
        for key in mine.model_fields_set & {"base", "gravity", "motors"}:
            if getattr(mine, key) != getattr(study, key):
                raise self.source.error(("robot", key), f"must be that of the study '{self.study.file}'")
        varied = {one.xacro or name for name, one in self.study.study.parameters.items() if not one.links}
        for name, value in mine.xacro.items():
            if name not in varied and study.xacro.get(name) != value:
                raise self.source.error(("robot", "xacro", name), "the study gives it another value, or none")
        known = [event.title for event in scene.events]
        for word in self.wanted.values():
            kind, _, name = word.partition(" ")
            if kind == EVENT:
                self.study.check(("tasks", self.task, "measure"), "event of the scene", name, known)
        if scene.controller is not None and scene.controller.kind == "python" and not allow_python:
            raise self.study.error(
                keys, "its controller is a Python program; allow it with allow_python=True"
            )

    def __call__(self, robot: HybridRobot, functions: Mapping[str, Callable[..., Any]]) -> dict[str, float]:
        """Simulate the scene with a robot, and measure the motion.

        Raises:
            HybridynError: The scene does not belong to this robot, or cannot be played to its end.
        """
        ready = stage(self.source, robot=robot, allow_python=True)  # asked when the study was read
        result = play(ready)
        if result.status not in ("finished", "event"):
            stopped = {"unreachable": AssemblyError, "singular": SingularityError}
            raise stopped.get(result.status, HybridynError)(f"{self.source.file}: {result.message}")
        return self._measured(ready.robot, result, functions)

    def _measured(
        self, robot: HybridRobot, result: SimulationResult, functions: Mapping[str, Callable[..., Any]]
    ) -> dict[str, float]:
        own = {name: _of_run(result, word) for name, word in self.wanted.items()}
        left = {name: word for name, word in self.wanted.items() if own[name] is None}
        block = TreeSamples(TableMotion(1, len(result.t), result.t), result.q, result.v, result.a)
        values = measured(robot, left, [(block, result.tau)], functions) | {
            name: value for name, value in own.items() if value is not None
        }
        return {name: values[name] for name in self.wanted}


def _of_run(result: SimulationResult, word: str) -> float | None:
    """Return a measure that only a simulation has; None for the others."""
    if word in OF_SCENE:
        return {"time": result.state.t, "events": float(len(result.events))}[word]
    kind, _, name = word.partition(" ")
    if kind == EVENT:
        return next((event.t for event in result.events if event.name == name), math.nan)
    if kind in STATISTICS and name in (*ENERGIES, RESIDUAL):
        columns = (result.kinetic, result.potential, result.energy, result.residual)
        by_name = dict(zip((*ENERGIES, RESIDUAL), columns, strict=True))
        return STATISTICS[kind](by_name[name], result.t)
    return None


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
    """

    design: int
    values: tuple[float, ...]
    status: str
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
        row, nothing = (
            partial(DesignRow, design, tuple(values.tolist())),
            (math.nan,) * len(self.source.columns),
        )
        try:
            robot = self.variants(self.variants.named(values))
        except Exception as error:
            return row("not loaded", nothing, said(error))
        measures, status, message = dict.fromkeys(self.source.columns, math.nan), "ok", ""
        for name, task in self.source.study.tasks.items():
            try:
                own = self._task(robot, name, task)
            except Exception as error:
                if status == "ok":
                    status, message = status_of(error), said(error)
            else:
                measures |= {self.source.column(name, key): value for key, value in own.items()}
        return row(status, tuple(measures.values()), message)

    def _task(self, robot: HybridRobot, name: str, task: TaskTable) -> dict[str, float]:
        if task.workspace is not None:
            return _in_workspace(robot, task, self.functions)
        if task.scene is not None:
            return self.players[name](robot, self.functions)
        blocks = [*follow(robot, self.tracks[name], task.passive, effects_of(robot, task))]
        return measured(robot, task.wanted, blocks, self.functions)


def effects_of(robot: HybridRobot, task: TaskTable) -> Effects:
    """Return the effects of a task; limits are none, since margins say more."""
    return choose(robot, task.effects).without("limits")


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
    )
    return {
        name: OF_WORKSPACE[word](found) if word in OF_WORKSPACE else call(functions, word, robot, found)
        for name, word in task.wanted.items()
    }


def said(error: Exception) -> str:
    """Return an error as the message of a row, one line."""
    text = str(error) if isinstance(error, HybridynError) else f"{type(error).__name__}: {error}"
    return " ".join(text.split())[:MESSAGE]
