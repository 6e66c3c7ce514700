"""A scene that every design plays: read once, then simulated with the robot of each design."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from ...errors import ActuationError, AssemblyError, SingularityError
from ...scenes.scene_file import read_scene
from ...scenes.stage import play, stage
from ...simulation.result import Result
from ...streams.postures import Postures
from ...structure.robot import HybridRobot
from ...tables.columns import ENERGIES, RESIDUAL
from ...tables.trajectory import Motion
from .following import Postmortem, status_of
from .measures import EVENT, OF_SCENE, STATISTICS, Gauge
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

    def __call__(
        self, robot: HybridRobot, functions: Mapping[str, Callable[..., Any]]
    ) -> tuple[Postmortem, dict[str, float]]:
        """Simulate the scene with a robot.

        Returns:
            What went wrong, and the measures where nothing did.

        Raises:
            HybridynError: The scene does not belong to this robot.
        """
        found = Postmortem()
        try:
            ready = stage(self.source, robot=robot, allow_python=True)  # asked when the study was read
            result = play(ready)
        except (AssemblyError, SingularityError, ActuationError) as error:
            _add(found, status_of(error), str(error))
            return found, {}
        if result.status not in ("finished", "event"):
            status = "failed" if result.status == "unsolved" else result.status
            _add(found, status, f"{self.source.file}: {result.message}")
            return found, {}
        return found, self._measured(ready.robot, result, functions)

    def _measured(
        self, robot: HybridRobot, result: Result, functions: Mapping[str, Callable[..., Any]]
    ) -> dict[str, float]:
        own = {name: _of_run(result, word) for name, word in self.wanted.items()}
        left = {name: word for name, word in self.wanted.items() if own[name] is None}
        gauge = Gauge(robot, left, functions)
        rows = Motion(1, len(result.t), result.t)
        gauge.add(Postures(rows, result.q, result.v, result.a), result.tau)
        values = gauge.values() | {name: value for name, value in own.items() if value is not None}
        return {name: values[name] for name in self.wanted}


def _add(found: Postmortem, status: str, message: str) -> None:
    found.unreachable += status == "unreachable"
    found.singular += status == "singular"
    found.add(status, message)


def _of_run(result: Result, word: str) -> float | None:
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
