"""Run a scene with any setting, and compare what runs came to.

A run takes one core. Its time is that of the processor, in which a busy machine shows little.
"""

from __future__ import annotations

import time as clock
from typing import Any

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
from .settings import Setting, setting_of

#: Number of measurements of a short run, and the longest time of such a run [s].
ROUNDS, SHORT = 3, 0.3
#: Part of a time that the first run takes at most. Where it is stopped, the scene is as many times as short,
#: since tighter tolerances take longer.
SHORTER = 4.0
#: Times at which postures are compared, as parts of a run; early ones judge a run that is stopped.
OUTPUTS = np.array([0.0, 0.01, 0.02, 0.05, 0.1, 0.2, 0.4, 0.6, 0.8, 1.0])
#: Part of a scene that is run before anything is timed.
BEGINNING = 1e-3
#: Relative tolerances: of the run that finds the end, and of those that lead to the reference.
FIRST, LADDER = 1e-6, (1e-8, 1e-10, 1e-11, 1e-12)


#: The outputs of a run so far, and its computing time [s].
Run = tuple[Result, float]


class Runner:
    """Runs one scene with any setting.

    Attributes:
        ready: The scene.
        duration: Time to simulate [s].
        start: Positions and rates at the start.
        reference, exact, own_error: Setting and run of the reference, and its error.
    """

    def __init__(self, ready: Stage, duration: float) -> None:
        self.ready, self.duration, self.start = ready, duration, (ready.q0, ready.v0)
        self.models = Models(ready.robot)

    def run(
        self, setting: Setting, limit: float, *, effects: Effects | None = None, watch: bool = False
    ) -> Run:
        """Run once.

        Args:
            limit: Processor time after which the run is stopped [s].
            effects: The effects; those of the scene by default.
            watch: Whether the scene's events may end the run.

        Raises:
            HybridynError: The run fails.
        """
        ready, on = self.ready, self.ready.effects if effects is None else effects
        model = self.models.compiled(on) if setting.compiled else None
        stopped = False
        start = clock.process_time()

        def after_step(t: float, end: float) -> None:
            """Stop a run that takes too long."""
            nonlocal stopped
            if clock.process_time() - start > limit:
                stopped = True
                raise KeyboardInterrupt

        result = simulate(
            ready.robot, *self.start, (0.0, self.duration), effort=ready.effort, effects=on, compiled=model,
            events=ready.events if watch else (), progress=after_step,
            output_times=self.duration * OUTPUTS, **setting.options,
        )  # fmt: skip
        seconds = clock.process_time() - start
        if result.status == "interrupted" and not stopped:
            raise KeyboardInterrupt
        if result.status not in ("finished", "event", "interrupted"):
            raise HybridynError(f"the run ended at {result.t[-1]:.3g} s: {result.status} {result.message}")
        return result, seconds

    def measured(self, setting: Setting, limit: float) -> Run:
        """Run, several times if a run is quick, and return the least time.

        Raises:
            HybridynError: As `run`.
        """
        result, seconds = self.run(setting, limit)
        again = ROUNDS - 1 if seconds < SHORT else 0
        return result, min([seconds, *(self.run(setting, limit)[1] for _ in range(again))])

    def find_reference(self, compiled: bool, limit: float) -> Result:
        """Find the end of the scene, and the reference: the tightest tolerance that takes so long.

        dopri5 is tried first, then the implicit method if fewer than two runs of dopri5 finish. Where the end
        is not reached in time, the scene ends early.

        Args:
            compiled: Whether accelerations are computed in C.
            limit: Time that the runs take together [s]; the one before takes a part of it at most.

        Returns:
            The run that found the end.

        Raises:
            HybridynError: There are no two runs to compare.
        """
        whole, why = self.duration, "two runs by dopri5 or the implicit method must finish"
        for method in ("dopri5", "implicit"):
            found: list[tuple[Setting, Result]] = []
            try:
                self.duration = BEGINNING * whole
                self.run(setting_of(method, FIRST, compiled), np.inf)  # builds and loads what it needs
                self.duration = whole
                first, _ = self.run(setting_of(method, FIRST, compiled), limit / SHORTER, watch=True)
                self.duration = float(first.state.t) / (1.0 if first.status != "interrupted" else SHORTER)
                left = limit
                for setting in (setting_of(method, rtol, compiled) for rtol in LADDER):
                    run, seconds = self.run(setting, left)
                    if run.status == "interrupted":
                        break
                    found.append((setting, run))
                    left -= seconds
            except HybridynError as error:
                why = str(error)
            if len(found) > 1:
                self.reference, self.exact = found[-1]
                own = errors(self.ready.robot, found[-2][1], self.exact)["error"]
                self.own_error = max(own, 2.0**-53)
                return first
        raise HybridynError(
            f"no reference: {why}. Simulate only the beginning (--until {self.duration / 2:.2g}), or give "
            "more time (--seconds)"
        )


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
