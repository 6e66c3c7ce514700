"""A scene that is simulated with the robots of designs, and what is measured of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from ...errors import AssemblyError, HybridynError, SingularityError
from ...scenes.scene_file import read_scene
from ...scenes.stage import play, stage
from ...simulation.result import SimulationResult
from ...streams.postures import TreeSamples
from ...structure.robot import HybridRobot
from ...tables.columns import ENERGIES, RESIDUAL
from ...tables.trajectory import TableMotion
from .measures import EVENT, OF_SCENE, STATISTICS, measured
from .study_file import StudyFile


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
        block = TreeSamples(
            TableMotion(1, len(result.t), result.t, {}, {}, {}, {}), result.q, result.v, result.a
        )
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
