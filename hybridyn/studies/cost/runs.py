"""Measure error and time of a scene's integration: method, step or tolerance, projection, C code, effects."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...errors import HybridynError
from ...linkage.joints import TreeJoint
from ...scenes.stage import Stage
from ...simulation.simulate import simulate
from ...spatial import Array
from ...structure.robot import HybridRobot
from .fragments import effects_fragment, solver_fragment
from .points import Point, Study
from .settings import FACTORS, Setting, of_effects, of_integration, own_options, usual_setting

if TYPE_CHECKING:
    from ...compiled.model import CompiledRobot

#: Time limit of a run [s]. Three times the time of the scene's own solver is allowed if that is longer.
LIMIT = 10.0

#: Relative tolerances of the runs that lead to the reference, coarse to fine.
LADDER = (1e-6, 1e-8, 1e-10, 1e-11, 1e-12)

#: Time limit of all reference runs of a method, relative to that of one run.
PATIENCE = 10

#: Number of measurements of a short run.
ROUNDS = 3


class Run(NamedTuple):
    """Result of a run.

    Attributes:
        q: The last posture, shape (nq,).
        seconds: Computing time [s].
        t: Time reached in the scene [s].
        steps: Steps taken.
    """

    q: Array
    seconds: float
    t: float
    steps: int


class TooLongError(HybridynError):
    """A run exceeded its time limit and was stopped."""


class Runner:
    """Runs one scene with any setting.

    Attributes:
        ready: The scene.
        duration: Time to simulate [s].
        limit: Time limit of a run [s].
    """

    def __init__(self, ready: Stage, duration: float, limit: float) -> None:
        self.ready, self.duration, self.limit = ready, duration, limit
        self._compiled: dict[str, CompiledRobot | HybridynError] = {}

    def compiled(self, dtype: str) -> CompiledRobot | None:
        """Return the scene's model compiled from C code, or None for the general path (`dtype` "").

        Raises:
            HybridynError: The model cannot be built.
        """
        if not dtype:
            return None
        if dtype not in self._compiled:
            from ...compiled.compiling import compile

            try:
                self._compiled[dtype] = compile(self.ready.robot, self.ready.effects, dtype=dtype)
            except HybridynError as error:
                self._compiled[dtype] = error
        model = self._compiled[dtype]
        if isinstance(model, HybridynError):
            raise model
        return model

    def run(self, setting: Setting, limit: float | None = None, *, watch: bool = False) -> Run:
        """Run once.

        Args:
            limit: Time limit [s]; `self.limit` by default.
            watch: Whether the scene's events may end the run.

        Raises:
            TooLongError: The run exceeds the time limit.
            HybridynError: The run fails.
        """
        ready, most = self.ready, self.limit if limit is None else limit
        model = self.compiled(setting.dtype)
        effects = ready.effects if setting.effects is None else ready.effects.only(setting.effects)
        late = [0.0]
        start = clock.perf_counter()

        def after_step(t: float, end: float) -> None:
            """Stop a run that takes too long."""
            if clock.perf_counter() - start > most:
                late[0] = t / end
                raise KeyboardInterrupt

        result = simulate(
            ready.robot, ready.q0, ready.v0, np.array([0.0, self.duration]), effort=ready.effort,
            effects=effects, compiled=model, events=ready.events if watch else (),
            output_times=None if watch else np.array([self.duration]), progress=after_step, **setting.options,
        )  # fmt: skip
        seconds = clock.perf_counter() - start
        if result.status == "interrupted":
            if not late[0]:
                raise KeyboardInterrupt
            raise TooLongError(f"given up after {most:.3g} s, at {100 * late[0]:.0f} % of the scene")
        if result.status not in ("finished", "event"):
            raise HybridynError(f"the run ended: {result.status} {result.message}".strip())
        t = float(result.state.t)
        return Run(np.array(result.state.q), seconds, t, result.counters.steps)

    def measured(self, setting: Setting) -> Run:
        """Run, several times if a run is quick, and return the least time.

        Raises:
            HybridynError: As `run`.
        """
        runs = [self.run(setting)]
        while len(runs) < ROUNDS and runs[0].seconds < 1.0:
            runs.append(self.run(setting))
        return runs[0]._replace(seconds=min(run.seconds for run in runs))


def study_runs(ready: Stage, duration: float, progress: Callable[[str], None], limit: float = LIMIT) -> Study:
    """Measure integrators on a scene.

    The error of a run is the distance of its last posture from that of the reference: the largest
    displacement of a joint, in radians or module lengths. The reference is the run with the tightest
    tolerance that finishes in time. Its own error is the distance to the run with the next looser tolerance.

    Args:
        duration: Time to simulate [s]; an event that stops the scene ends every run there.
        progress: Called with the name of each measurement.
        limit: Time limit of a run [s]; three times the time of the scene's own solver if that is longer.

    Raises:
        HybridynError: The scene cannot be simulated at all.
    """
    runner = Runner(ready, duration, np.inf)
    usual = usual_setting(own_options(ready))
    progress("as the scene says")
    first = runner.run(usual, watch=True)
    runner.duration, runner.limit = first.t, max(limit, 3 * first.seconds)
    progress("reference")
    exact, own_error, words = _reference(runner)
    settings = [
        usual,
        *of_integration(typical_step(first.steps, first.t)),
        *of_effects(ready.effects.names, own_options(ready)),
    ]
    points = list(_points(runner, settings, exact, progress))
    ended = "" if first.t >= duration * (1 - 1e-12) else ", where an event ends it"
    question = f"error of the last posture (after {first.t:.6g} s{ended}) against time of the run"
    return Study(question, points, words, own_error, "per run", "the last posture", "what the scene says")


def typical_step(steps: int, duration: float) -> float:
    """Return a round step [s] near a run's mean step, such that the coarsest fixed step fits in the run."""
    return float(f"{min(duration / steps, 0.9 * duration / FACTORS[0]):.1g}")


def _points(
    runner: Runner, settings: Sequence[Setting], exact: Array, progress: Callable[[str], None]
) -> Iterator[Point]:
    """Measure settings; after a run that took too long, finer settings of the same line are skipped."""
    given_up: dict[str, str] = {}
    for setting in settings:
        progress(f"{setting.line}, {setting.words}")
        point = _point_of(runner.ready, setting)
        if setting.line in given_up:
            yield replace(point, failure=f"not tried: the one before was {given_up[setting.line]}")
            continue
        try:
            run = runner.measured(setting)
        except TooLongError as failure:
            given_up[setting.line] = str(failure)
            yield replace(point, failure=str(failure))
            continue
        except HybridynError as failure:
            yield replace(point, failure=str(failure))
            continue
        error = distance(runner.ready.robot, run.q, exact)
        yield replace(point, error=error, seconds=run.seconds, own=run.seconds)


def _point_of(ready: Stage, setting: Setting) -> Point:
    """Return the point of a setting before it is measured."""
    if setting.effects is None:
        fragment = solver_fragment(setting.options, setting.dtype)
        what = f"take {setting.line}, {setting.words}".removesuffix(" (usual)")
    else:
        fragment = effects_fragment(ready.source, setting.effects)
        what = setting.words.replace("without", "drop", 1)
    if setting.use == "usual":
        what = "keep what the scene says"
    return Point(setting.line, setting.words, np.inf, np.inf, fragment, use=setting.use, what=what)


def _reference(runner: Runner) -> tuple[Array, float, str]:
    """Compute the reference: the last posture at the tightest tolerance of `LADDER` that finishes in time.

    dopri5 is tried first, then the implicit method if fewer than two runs of dopri5 finish.

    Returns:
        The last posture, shape (nq,), its own error, and a description of the run.
    """
    dtype = "float64"
    try:
        runner.compiled(dtype)
    except HybridynError:
        dtype = ""
    reason: HybridynError | None = None
    for method in ("dopri5", "implicit"):
        found: list[tuple[float, Array]] = []
        left = PATIENCE * runner.limit
        for rtol in LADDER:
            options = {"method": method, "rtol": rtol, "atol": rtol * 1e-2}
            try:
                run = runner.run(Setting("", "", options, dtype=dtype), min(left, 3 * runner.limit))
            except HybridynError as error:
                reason = error
                break
            left -= run.seconds
            found.append((rtol, run.q))
        if len(found) > 1:
            own = max(distance(runner.ready.robot, found[-2][1], found[-1][1]), 2.0**-53)
            engine = ", accelerations in C" if dtype else ""
            return found[-1][1], own, f"{method} at a relative tolerance of {found[-1][0]:g}{engine}"
    raise HybridynError(
        f"no reference: two runs by dopri5 or the implicit method must finish ({reason}). Simulate only the "
        "beginning (--until), or raise the time limit (--limit)"
    )


def distance(robot: HybridRobot, q0: Array, q1: Array) -> float:
    """Return the largest displacement of a joint between two postures, in radians or module lengths."""
    worst = 0.0
    unit = {joint: m.mechanism.length for m in robot.modules for joint in m.joints}
    for name, kind, at in zip(robot.joints, robot.kinds, robot.q_slices, strict=True):
        joint = TreeJoint(name, kind, 0, np.eye(3), np.zeros(3), np.array([0.0, 0.0, 1.0]))  # type: ignore[arg-type]
        move = joint.difference(q0[None, at], q1[None, at])[0]
        sliding = {"prismatic": 1, "planar": 2, "floating": 3}.get(kind, 0)
        length = unit.get(name, 1.0)
        worst = max(
            worst, np.abs(move[:sliding]).max(initial=0.0) / length, np.abs(move[sliding:]).max(initial=0.0)
        )
    return float(worst)
