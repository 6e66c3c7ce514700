"""Runs of one scene with any setting, their reference, and the distance from it."""

from __future__ import annotations

import contextlib
import logging
import time as clock
from collections.abc import Iterator
from typing import Any

import numpy as np
import pinocchio as pin

from ...compiled import compile
from ...effects.choice import Effects
from ...errors import HybridynError
from ...scenes.stage import SceneStage
from ...simulation.result import SimulationResult
from ...simulation.simulate import simulate
from ...spatial import Array
from ...structure.robot import HybridRobot
from .solver_settings import Setting, setting_of

#: Relative tolerances: of the run that finds the end, and of those that lead to the reference.
FIRST, LADDER = 1e-6, (1e-8, 1e-10, 1e-11, 1e-12)

#: Part of a time that the first run takes at most. Where it is stopped, the scene is as many times as short,
#: since tighter tolerances take longer.
SHORTER = 4.0
#: Times at which postures are compared, as parts of a run: an error between two of them shows at both. The
#: general path interpolates slowly: without compiled models, each of so many is taken.
OUTPUTS, SPARSE = np.linspace(0.0, 1.0, 201), 8
#: Part of a scene that is run before anything is timed.
BEGINNING = 1e-6

#: Relative tolerance of the runs that show what effects are worth: their changes matter from 1e-3 on.
OF_EFFECTS = 1e-8

#: The outputs of a run so far, and its computing time [s].
Run = tuple[SimulationResult, float]


class Runner:
    """Runs one scene with any setting.

    Attributes:
        ready: The scene.
        duration: Time to simulate [s].
        start: Positions and rates at the start.
        compiled: Whether there are compiled models.
        sticks: Whether joints of the scene stick.
        came: How far the last run came [s].
        reference, exact, own_error: Setting and run of the reference, and its error.
        near: The looser settings that led to the reference, with their runs, until they are measured.
    """

    def __init__(self, ready: SceneStage, duration: float) -> None:
        self.ready, self.duration, self.start, self.compiled = ready, duration, (ready.q0, ready.v0), True
        self.sticks = ready.source.scene.solver.stiction
        self.near = dict[str, tuple[Setting, Run]]()

    def run(
        self, setting: Setting, limit: float, *, effects: Effects | None = None, watch: bool = False,
        outputs: Array | None = None,
    ) -> Run:  # fmt: skip
        """Run once.

        Args:
            limit: Processor time after which the run is stopped [s].
            effects: The effects; those of the scene by default.
            watch: Whether the scene's events may end the run.
            outputs: Times of its outputs, as parts of the duration; by default those that are compared.

        Raises:
            HybridynError: The run fails.
        """
        ready, on = self.ready, self.ready.effects if effects is None else effects
        model = compile(ready.robot, on, wait=True) if setting.compiled else None
        start, self.came = clock.process_time(), 0.0

        def after_step(t: float, end: float) -> None:
            """Stop a run that takes too long."""
            self.came = t
            if clock.process_time() - start > limit:
                raise KeyboardInterrupt

        result = simulate(
            ready.robot, *self.start, (0.0, self.duration), effort=ready.effort, effects=on, compiled=model,
            events=ready.events if watch else (), progress=after_step,
            output_times=self.duration * (self.outputs if outputs is None else outputs), **setting.options,
        )  # fmt: skip
        seconds = clock.process_time() - start
        if result.status == "interrupted" and seconds <= limit:
            raise KeyboardInterrupt
        if result.status not in ("finished", "event", "interrupted"):
            raise HybridynError(f"the run ended at {result.t[-1]:.3g} s: {result.status} {result.message}")
        return result, seconds

    @property
    def outputs(self) -> Array:
        """Times at which postures are compared, as parts of the duration."""
        return OUTPUTS if self.compiled else OUTPUTS[::SPARSE]

    def whole(self, limit: float, effects: Effects) -> SimulationResult:
        """Run to the end with some effects, to see what they change.

        Raises:
            HybridynError: The run fails, or takes too long.
        """
        with untold("hybridyn.compiled"):  # of models that nobody asked for
            found, _ = self.run(
                setting_of("dopri5", OF_EFFECTS, self.compiled, self.sticks), limit, effects=effects
            )
        if found.status == "interrupted":
            raise HybridynError(
                f"a run came to {self.came:.2g} s of {self.duration:.2g} s in {limit:.2g} s of computing: "
                "--seconds gives more time"
            )
        return found

    def find_reference(self, limit: float) -> SimulationResult:
        """Find the end of the scene, and the reference: the tightest tolerance that takes so long.

        dopri5 is tried first, then the implicit method if fewer than two runs of dopri5 finish. Where the end
        is not reached in time, the scene ends early.

        Args:
            limit: Time that a run takes [s]; the first one takes a part of it at most.

        Returns:
            The run that found the end.

        Raises:
            HybridynError: There are no two runs to compare.
        """
        whole, why = self.duration, "two runs by dopri5 or the implicit method must finish"
        came = 0.0
        for method in ("dopri5", "implicit"):
            found: list[tuple[Setting, Run]] = []
            try:
                setting = setting_of(method, FIRST, self.compiled, self.sticks)
                self.duration = BEGINNING * whole
                self.run(setting, np.inf)  # builds and loads what it needs
                self.duration = whole
                first, _ = self.run(setting, limit / SHORTER, watch=True)
                self.duration = float(first.state.t) / (1.0 if first.status != "interrupted" else SHORTER)
                for one in self._tighter(method, limit):
                    found.append(one)
            except HybridynError as error:
                why = str(error)
            came = max(came, self.came)
            if len(found) > 1:
                self.reference, (self.exact, _) = found.pop()
                own = errors(self.ready.robot, found[-1][1][0], self.exact)["error"]
                self.near, self.own_error = {one[0].fragment: one for one in found}, max(own, 2.0**-53)
                return first
        beginning = f"Simulate only the beginning (--until {came / 2:.2g}), or give"
        if came <= BEGINNING * whole:
            beginning = "Give"
        raise HybridynError(f"no reference: {why}. {beginning} more time (--seconds)")

    def _tighter(self, method: str, limit: float) -> Iterator[tuple[Setting, Run]]:
        """Yield the runs of tighter and tighter tolerances that end in time, two if any takes long."""
        for number, rtol in enumerate(LADDER):
            setting = setting_of(method, rtol, self.compiled, self.sticks)
            run, seconds = self.run(setting, limit)
            if run.status == "interrupted":
                return
            yield setting, (run, seconds)
            if number and seconds > limit / SHORTER:
                return


@contextlib.contextmanager
def untold(name: str) -> Iterator[None]:
    """Drop what a logger says."""
    logger, drop = logging.getLogger(name), lambda record: False
    logger.addFilter(drop)
    try:
        yield
    finally:
        logger.removeFilter(drop)


def errors(robot: HybridRobot, found: SimulationResult, exact: SimulationResult) -> dict[str, Any]:
    """Return the errors of a run: of its last posture, path, energy, and its closures.

    Of a run that was stopped, or is compared with one that was, the error at the end is not known: infinite.
    """
    if "interrupted" in (found.status, exact.status):
        return {"error": np.inf}
    away = way_off(robot, found, exact)
    lost = (found.kinetic + found.potential) - (exact.kinetic + exact.potential)
    energy = float(np.abs(lost).max() / (exact.kinetic.max() or 1.0))
    return {
        "error": away[-1], "path": max(away), "energy": energy, "closure": float(found.residual.max()),
    }  # fmt: skip


def way_off(robot: HybridRobot, found: SimulationResult, exact: SimulationResult) -> list[float]:
    """Return the distance from the exact posture at each output that a run came to."""
    return [distance(robot, *pair) for pair in zip(found.q, exact.q, strict=False)]


def distance(robot: HybridRobot, q0: Array, q1: Array) -> float:
    """Return the largest displacement of a joint between two postures, in radians or module lengths."""
    move = pin.difference(robot.unchanged_model, q0, q1)
    return float(np.abs(move / robot.unit).max(initial=0.0))
