"""Run a scene with any setting, and compare what runs came to."""

from __future__ import annotations

import time as clock
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from ...effects.choice import Effects
from ...errors import HybridynError
from ...scenes.stage import Stage
from ...simulation.result import Result
from ...simulation.simulate import simulate
from ...spatial import Array
from ...structure.robot import HybridRobot
from .quantities import Models
from .settings import Setting

#: Number of measurements of a short run, and the longest time of such a run [s].
ROUNDS, SHORT = 3, 0.3
#: Postures of a run that are compared.
OUTPUTS = 50


class Run(NamedTuple):
    """A run: its outputs so far, computing time [s], time reached [s], and whether it came to the end."""

    result: Result
    seconds: float
    t: float
    whole: bool


class Runner:
    """Runs one scene with any setting.

    Attributes:
        ready: The scene.
        duration: Time to simulate [s].
        start: Positions and rates at the start.
        reference, exact: The setting of the reference, and its run.
        tried: Settings that were run, by line and words.
    """

    reference: Setting
    exact: Result

    def __init__(self, ready: Stage, duration: float) -> None:
        self.ready, self.duration, self.start = ready, duration, (ready.q0, ready.v0)
        self.models, self.tried = Models(ready.robot), dict[tuple[str, str], Setting]()

    def run(
        self, setting: Setting, limit: float, *, effects: Effects | None = None, watch: bool = False
    ) -> Run:
        """Run once.

        Args:
            limit: Time after which the run is stopped [s].
            effects: The effects; those of the scene by default.
            watch: Whether the scene's events may end the run.

        Raises:
            HybridynError: The run fails.
        """
        ready, on = self.ready, self.ready.effects if effects is None else effects
        model = self.models.compiled(on, setting.dtype) if setting.dtype else None
        stopped = False
        start = clock.perf_counter()

        def after_step(t: float, end: float) -> None:
            """Stop a run that takes too long."""
            nonlocal stopped
            if clock.perf_counter() - start > limit:
                stopped = True
                raise KeyboardInterrupt

        result = simulate(
            ready.robot, *self.start, (0.0, self.duration), effort=ready.effort, effects=on, compiled=model,
            events=ready.events if watch else (), progress=after_step,
            output_times=None if watch else np.linspace(0.0, self.duration, OUTPUTS + 1), **setting.options,
        )  # fmt: skip
        seconds = clock.perf_counter() - start
        if result.status == "interrupted" and not stopped:
            raise KeyboardInterrupt
        if result.status not in ("finished", "event", "interrupted"):
            raise HybridynError(f"the run ended: {result.status} {result.message}".strip())
        return Run(result, seconds, float(result.state.t), not stopped)

    def measured(self, setting: Setting, limit: float) -> Run:
        """Run, several times if a run is quick, and return the least time.

        Raises:
            HybridynError: As `run`.
        """
        runs = [self.run(setting, limit)]
        while len(runs) < ROUNDS and runs[0].seconds < SHORT:
            runs.append(self.run(setting, limit))
        return runs[0]._replace(seconds=min(run.seconds for run in runs))


def errors(robot: HybridRobot, found: Result, exact: Result) -> dict[str, Any]:
    """Return the errors of a run as far as it came: of its last posture, path, energy, and its closures."""
    count = min(len(found.t), len(exact.t))
    if count < 2:  # it was stopped before there was a posture to compare
        return {"error": np.inf}
    away = [distance(robot, *pair) for pair in zip(found.q[:count], exact.q[:count], strict=True)]
    lost = (found.kinetic + found.potential)[:count] - (exact.kinetic + exact.potential)[:count]
    energy = float(np.abs(lost).max() / (exact.kinetic.max() or 1.0))
    return {
        "error": away[-1], "path": max(away), "energy": energy,
        "closure": float(found.residual[:count].max()),
    }  # fmt: skip


def distance(robot: HybridRobot, q0: Array, q1: Array) -> float:
    """Return the largest displacement of a joint between two postures, in radians or module lengths."""
    move = pin.difference(robot.unchanged_model, q0, q1)
    return float(np.abs(move / robot.unit).max(initial=0.0))
