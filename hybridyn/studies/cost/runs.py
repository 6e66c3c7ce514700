"""Measure error and time of a scene's integration: method, step or tolerance, compiled or not, effects.

Accelerations are compiled where they can be. The general path takes a hundred times as long: it runs for a
short time only, and its time is extrapolated. So is that of any run that takes too long; its error is then
that up to the posture it came to. At most four models are built: of the scene's effects, in float32 too, of
every effect that is stated, and of the effects that are needed. Single effects are those of the general path.
"""

from __future__ import annotations

import time as clock
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pinocchio as pin

from ...compiled.compiling import compile
from ...effects.choice import UNITS, Effects, choose, stated_names
from ...errors import HybridynError
from ...scenes.stage import Stage
from ...simulation.result import Result
from ...simulation.simulate import simulate
from ...spatial import Array
from ...structure.robot import HybridRobot
from .models import spared, without
from .points import ADVISED, SECONDS, Point, Progress, Step, Study, Worth, cheapest, fill
from .quantities import SLOWER, operations
from .settings import (
    FACTORS,
    Setting,
    effects_fragment,
    families,
    setting_of,
    usual_setting,
)

#: Number of measurements of a short run, and the longest time of such a run [s].
ROUNDS, SHORT = 3, 0.3
#: Part of a time that the first run takes at most. Where it is stopped, the scene is as many times as short,
#: since tighter tolerances take longer.
SHORTER = 4.0
#: Times at which postures are compared, as parts of a run; early ones judge a run that is stopped. A
#: controller in Python takes long at each.
OUTPUTS = np.array([0.0, 0.01, 0.03, 0.1, 0.3, 0.6, 1.0])
#: Part of a scene that is run in C before anything is timed.
BEGINNING = 1e-6
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
        near: The looser settings that led to the reference, with their runs, until they are measured.
    """

    def __init__(self, ready: Stage, duration: float) -> None:
        self.ready, self.duration, self.start = ready, duration, (ready.q0, ready.v0)
        self.near = dict[str, tuple[Setting, Run]]()

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
        model = compile(ready.robot, on) if setting.compiled else None
        stopped, start = False, clock.process_time()

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
        result, seconds = self.near.pop(setting.fragment, (setting, None))[1] or self.run(setting, limit)
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
            found: list[tuple[Setting, Run]] = []
            try:
                if compiled:
                    self.duration = BEGINNING * whole
                    self.run(setting_of(method, FIRST, compiled), np.inf)  # builds and loads what it needs
                self.duration = whole
                first, _ = self.run(setting_of(method, FIRST, compiled), limit / SHORTER, watch=True)
                self.duration = float(first.state.t) / (1.0 if first.status != "interrupted" else SHORTER)
                left = limit
                for setting in (setting_of(method, rtol, compiled) for rtol in LADDER):
                    run, seconds = self.run(setting, limit)
                    if run.status == "interrupted":
                        break
                    found.append((setting, (run, seconds)))
                    left -= seconds
                    if len(found) > 1 and left < 2.0 * seconds:  # the next one takes longer
                        break
            except HybridynError as error:
                why = str(error)
            if len(found) > 1:
                self.reference, (self.exact, _) = found.pop()
                own = errors(self.ready.robot, found[-1][1][0], self.exact)["error"]
                self.near = {setting.fragment: (setting, run) for setting, run in found}
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


#: Parts of `SECONDS`: for one family of settings, for the reference, and for each effect.
ONE_FAMILY, REFERENCE, ONE_EFFECT = 1 / 16, 1 / 10, 1 / 40
#: Relative tolerance of the runs that show what effects are worth together, and what one is, by the general
#: path: changes matter from 1e-3 on.
OF_EFFECTS, OF_ONE = 1e-8, 1e-5
#: Effects that can be left out without changing the task of a scene.
DROPPABLE = (
    "leg_inertia", "velocity", "rotor_inertia", "viscous_friction", "coulomb_friction", "stribeck_friction",
)  # fmt: skip


def study_runs(
    ready: Stage,
    duration: float,
    progress: Progress = lambda result: None,
    seconds: float = SECONDS,
    study: Study | None = None,
    target: float = ADVISED,
) -> Study:
    """Measure integrators on a scene.

    The error of a run is the distance of its last posture from that of the reference: the largest
    displacement of a joint, in radians or module lengths. The reference is the run with the tightest
    tolerance that finishes in time. Its own error is the distance to the run with the next looser tolerance.

    Args:
        duration: Time to simulate [s]; an event that stops the scene ends every run there.
        progress: Called with each setting and each effect when it is measured.
        seconds: Time that the measurements take [s], besides building C.
        study: Filled as points are measured; a new one by default.
        target: Error for which the advised setting is run on a second motion, too, and effects are chosen.

    Raises:
        HybridynError: The scene cannot be simulated at all.
    """
    study = Study("", "per run") if study is None else study
    study.subject, study.usual = "the last posture", "what the scene says"
    study.second = f"a motion that begins where this one ends, at {SLOWER:g} times the rates"
    runner, limit, in_c = Runner(ready, duration), seconds * ONE_FAMILY, True
    try:
        compile(ready.robot, ready.effects)
    except HybridynError as error:
        in_c = False
        study.remarks.append(f"no compiled models: {error}")
    first = runner.find_reference(in_c, seconds * REFERENCE)
    if first.status == "interrupted":
        study.remarks.append(
            f"only the first {runner.duration:.3g} s are measured: --seconds gives more time"
        )
    ended = ", where an event ends it" if first.status == "event" else ""
    study.question = (
        f"error of the last posture (after {runner.duration:.6g} s{ended}) against time of the run"
    )
    tolerance, study.own_error = runner.reference.options["rtol"], runner.own_error
    study.reference = f"{runner.reference.line} at a relative tolerance of {tolerance:g}"

    usual = usual_setting(ready.source, in_c)
    general = usual._replace(line="general path", compiled=False, use="command")
    step = None if usual.options["method"] == "dopri5" else usual.options.get("step")
    quick, *others = families(step or typical_step(first.counters.steps, runner.duration), in_c)
    tried = dict[str, Setting]()
    steps: list[Step] = [
        (family[0].line, len(family), _family(runner, family, tried, limit))
        for family in (
            [setting for setting, _ in runner.near.values()],
            quick,
            [usual],
            *([[general]] * in_c),
            *others,
        )
    ]
    every = every_effect(ready)
    steps.insert(
        -len(others), ("effects", len(DROPPABLE), _worth(study, runner, every, seconds * ONE_EFFECT))
    )
    fill(study, steps, progress)
    if needed := needed_effects(study, ready, target):
        needed, said = _checked(runner, every, needed, target, in_c, limit, study.second)
        study.needed = [*effects_fragment(ready.source, needed).split("\n"), *(f"# {line}" for line in said)]
    _elsewhere(study, runner, tried, target)
    return study


def typical_step(steps: int, duration: float) -> float:
    """Return a round step [s] near a run's mean step, such that the coarsest fixed step fits in the run."""
    return float(f"{min(duration / steps, 0.9 * duration / FACTORS[0]):.1g}")


def _family(runner: Runner, family: list[Setting], tried: dict[str, Setting], left: float) -> Iterator[Point]:
    """Measure settings from coarse to fine, until one takes too long or is as exact as the reference.

    A run that is stopped is judged up to where it came to. One that fails is followed by a finer one.

    Args:
        tried: Receives the settings, by their lines to paste.
        left: Time of the family [s].
    """
    for setting in (one for one in family if one.use == "usual" or one.fragment not in tried):
        try:
            run, seconds = runner.measured(setting, left)
        except HybridynError:  # a step that is too long for the motion
            if setting is family[-1]:
                raise
            left /= 2.0
            continue
        part = float(run.state.t) / runner.duration
        how = f"the first {100 * part:.2g} % of the scene, time extrapolated" if part < 1 - 1e-12 else ""
        what = f"take {setting.line}, {setting.words}"
        tried[setting.fragment] = setting
        point = Point(
            setting.line, setting.words, seconds=seconds / part, fragment=setting.fragment,
            use=setting.use, what="keep what the scene says" if setting.use == "usual" else what,
            own=seconds / part, how=how, **errors(runner.ready.robot, run, runner.exact),
        )  # fmt: skip
        yield point
        left -= seconds
        if how or left <= 0 or point.error <= runner.own_error:
            return


def _elsewhere(study: Study, runner: Runner, tried: dict[str, Setting], target: float) -> None:
    """Run the advised setting on a second motion, and fill in its error there."""
    best, end = cheapest(study, target), runner.exact.state
    if best is None:
        return
    runner.start = end.q, SLOWER * end.v
    try:
        exact, run = (runner.run(one, np.inf)[0] for one in (runner.reference, tried[best.fragment]))
    except HybridynError as failure:
        study.remarks.append(f"{study.second}: {failure}")
        return
    error = errors(runner.ready.robot, run, exact)["error"]
    study.points[study.points.index(best)] = replace(best, elsewhere=error)


def _worth(study: Study, runner: Runner, every: Effects, limit: float) -> Iterator[Worth]:
    """Measure what each effect changes: those of the scene if left out, those of the files if added.

    Args:
        every: Effects of the scene and of the files.
        limit: Time of a run [s]; one that does not come to the end is compared as far as it came.
    """
    robot, on = runner.ready.robot, runner.ready.effects
    setting, whole = setting_of("dopri5", OF_ONE, compiled=False), operations(robot, on, "ddm")
    exact, _ = runner.run(setting, limit)
    for name in (name for name in DROPPABLE if name in every.names):
        computed = name in on.names
        other = without(on, [name]) if computed else every.only([*on.names, name])
        share = operations(robot, other, "ddm") / whole - 1.0
        try:
            change = errors(robot, runner.run(setting, limit, effects=other)[0], exact)["error"]
        except HybridynError:  # a motion without mass
            change = np.inf
        yield Worth(name, change, -share if computed else share, computed)
    if exact.status == "interrupted":
        study.remarks.append(f"effects are those of the first {exact.t[-1]:.2g} s: --seconds gives more time")


def _checked(
    runner: Runner,
    every: Effects,
    needed: list[str],
    target: float,
    compiled: bool,
    limit: float,
    second: str,
) -> tuple[list[str], list[str]]:
    """Run the effects that seem needed and those of the scene against every effect.

    Returns:
        The effects that are needed: every effect, where fewer miss the target. And how far the ends are
        from that with every effect, in words.
    """
    robot, run = runner.ready.robot, partial(runner.run, setting_of("dopri5", OF_EFFECTS, compiled), limit)
    sets = {"these": every.only(needed), "those of the scene": runner.ready.effects}
    try:
        exact, _ = run(effects=every)
        away = {words: errors(robot, run(effects=on)[0], exact)["error"] for words, on in sets.items()}
        said = [
            f"with {words}, the end is {error:.1e} from that with every effect that is stated"
            for words, error in away.items()
        ]
        if away["these"] > target:
            return [*every.names], ["every effect that is stated: fewer miss the target", *said[1:]]
        runner.start = exact.state.q, SLOWER * exact.state.v
        elsewhere = errors(robot, run(effects=sets["these"])[0], run(effects=every)[0])["error"]
        if elsewhere > target:
            said.append(f"these do not carry over to {second}: there the end is {elsewhere:.1e} away")
        return needed, said
    except HybridynError as failure:
        return needed, [f"not run with every effect that is stated: {failure}"]


def every_effect(ready: Stage) -> Effects:
    """Return the effects of a scene with those of `DROPPABLE` that the robot's files state besides."""
    on, stated = ready.effects, choose(ready.robot, ["default", *stated_names(ready.robot)])
    more = stated.only([name for name in DROPPABLE if name not in on.names])
    return replace(
        on, leg_inertia=on.leg_inertia or more.leg_inertia, velocity=on.velocity or more.velocity,
        joints=(*on.joints, *more.joints), rotors=(*on.rotors, *more.rotors),
        names=tuple(unit for unit in UNITS if unit in {*on.names, *more.names}),
    )  # fmt: skip


def needed_effects(study: Study, ready: Stage, target: float) -> list[str]:
    """Return the effects that a scene needs for an error, or nothing if it names them.

    Effects are left out, the least important first, as long as their changes together stay below the target.
    """
    more = [one.effect for one in study.worth if not one.computed and one.error > target]
    worth = {one.effect: one.error for one in study.worth}
    gone = spared(study.worth, target, lambda names: sum(worth[name] for name in names))
    if not more and not gone:
        return []
    return [name for name in UNITS if name in {*ready.effects.names, *more} - {*gone}]
