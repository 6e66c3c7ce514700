"""Measure error and time of a scene's integration: method, step or tolerance, compiled or not, effects.

Accelerations are compiled where they can be. The general path takes a hundred times as long: it runs for a
short time only, and its time is extrapolated. So is that of any run that takes too long; its error is then
that up to the posture it came to.
"""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from ...effects.choice import UNITS, Effects, choose
from ...errors import HybridynError
from ...scenes.stage import Stage
from ...simulation.result import Result
from .fragments import effects_fragment, solver_fragment
from .points import ADVISED, SECONDS, Point, Study, Worth, cheapest
from .quantities import SLOWER, operations
from .runner import Run, Runner, errors
from .settings import FACTORS, Setting, families, setting_of, usual_setting

#: Parts of `SECONDS`: for one family of settings, for the general path, and for the effects together.
ONE_RUN, SLOW_RUN, FOR_EFFECTS = 1 / 12, 1 / 20, 1 / 4
#: Relative tolerances of the runs that lead to the reference, coarse to fine.
LADDER = (1e-6, 1e-8, 1e-10, 1e-11, 1e-12)
#: Relative tolerance of the runs that show what effects are worth, compiled and by the general path.
OF_EFFECTS, SLOWLY = 1e-8, 1e-5
#: Effects that can be left out without changing the task of a scene.
DROPPABLE = (
    "leg_inertia", "velocity", "rotor_inertia", "viscous_friction", "coulomb_friction", "stribeck_friction",
)  # fmt: skip


def study_runs(
    ready: Stage,
    duration: float,
    progress: Callable[[Point], None] = lambda point: None,
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
        progress: Called with each point when it is measured.
        seconds: Time that the measurements take [s], besides building C.
        study: Filled as points are measured; a new one by default.
        target: Error for which the advised setting is run on a second motion, too.

    Raises:
        HybridynError: The scene cannot be simulated at all.
    """
    study = Study("", "per run") if study is None else study
    study.subject, study.usual = "the last posture", "what the scene says"
    study.second = f"a motion that begins where this one ends, at {SLOWER:g} times the rates"
    runner = Runner(ready, duration)
    for point in _points(study, runner, seconds):
        study.points.append(point)
        progress(point)
    _elsewhere(study, runner, target)
    return study


def _points(study: Study, runner: Runner, seconds: float) -> Iterator[Point]:
    """Yield the points of a study as they are measured, and fill in the rest of it."""
    ready, one = runner.ready, seconds * ONE_RUN
    engines: tuple[str, ...] = ("float64", "float32")
    try:
        runner.models.compiled(ready.effects)
    except HybridynError as error:
        engines = ("",)
        study.remarks.append(f"no compiled models: {error}")
    usual = usual_setting(ready, engines[0])
    first = _first(runner, engines[0], usual, 2 * one)
    ended = "" if first.t >= runner.duration * (1 - 1e-12) or not first.whole else ", where an event ends it"
    if not first.whole:
        study.remarks.append(
            f"only the first {first.t:.3g} s of the scene are measured: --seconds gives more time"
        )
    runner.duration = first.t
    study.question = (
        f"error of the last posture (after {runner.duration:.6g} s{ended}) against time of the run"
    )
    runner.reference, runner.exact, study.own_error = _reference(runner, engines[0], seconds)
    tolerance = runner.reference.options["rtol"]
    study.reference = f"{runner.reference.line} at a relative tolerance of {tolerance:g}"

    def judged(setting: Setting, run: Run) -> Point:
        """Return the point of a run; one that was stopped is judged up to where it came to."""
        part, took = run.t / runner.duration, run.seconds * runner.duration / run.t
        how = "" if run.whole else f"the first {100 * part:.2g} % of the scene, time extrapolated"
        runner.tried[setting.line, setting.words] = setting
        return replace(
            _point_of(ready, setting), seconds=took, own=took, part=part, how=how,
            **errors(ready.robot, run.result, runner.exact),
        )  # fmt: skip

    step = usual.options.get("step") if usual.options["method"] != "dopri5" else None
    quick, *others = families(step or typical_step(first.result.counters.steps, first.t), engines)
    yield from _family(runner, quick, judged, one, study.own_error)
    yield from _family(runner, [usual], judged, one, study.own_error)
    if engines[0]:
        general = usual._replace(line="general path", dtype="", use="command")
        yield from _family(runner, [general], judged, seconds * SLOW_RUN, study.own_error)
    _worth(study, runner, seconds * FOR_EFFECTS)
    for family in others:
        yield from _family(runner, family, judged, one, study.own_error)


def _first(runner: Runner, dtype: str, usual: Setting, limit: float) -> Run:
    """Run the scene once, to see where an event or its time ends it and how long its steps are."""
    try:
        return runner.run(setting_of("dopri5", OF_EFFECTS, dtype), limit, watch=bool(runner.ready.events))
    except HybridynError:
        return runner.run(usual, np.inf, watch=True)


def typical_step(steps: int, duration: float) -> float:
    """Return a round step [s] near a run's mean step, such that the coarsest fixed step fits in the run."""
    return float(f"{min(duration / steps, 0.9 * duration / FACTORS[0]):.1g}")


def _family(
    runner: Runner, family: list[Setting], judged: Callable[[Setting, Run], Point], left: float, least: float
) -> Iterator[Point]:
    """Measure settings from coarse to fine, until one takes too long or is as exact as the reference.

    Args:
        left: Time of the family [s].
        least: Error of the reference.
    """
    for setting in family:
        try:
            run = runner.measured(setting, left)
        except HybridynError as failure:
            yield replace(_point_of(runner.ready, setting), failure=str(failure))
            return
        point = judged(setting, run)
        yield point
        left -= run.seconds
        if not run.whole or left <= 0 or point.error <= least:
            return


def _point_of(ready: Stage, setting: Setting) -> Point:
    """Return the point of a setting before it is measured."""
    fragment = solver_fragment(setting.options, setting.dtype)
    what = f"take {setting.line}, {setting.words}".removesuffix(" (usual)")
    if setting.use == "usual":
        what = "keep what the scene says"
    return Point(setting.line, setting.words, np.inf, np.inf, fragment, use=setting.use, what=what)


def _reference(runner: Runner, dtype: str, seconds: float) -> tuple[Setting, Result, float]:
    """Find the reference: the tightest tolerance of `LADDER` that finishes in time, and its own error.

    dopri5 is tried first, then the implicit method if fewer than two runs of dopri5 finish.
    """
    for method in ("dopri5", "implicit"):
        found: list[tuple[Setting, Result]] = []
        left = seconds / 3
        for rtol in LADDER:
            setting = setting_of(method, rtol, dtype)
            try:
                run = runner.run(setting, left)
            except HybridynError:
                break
            if not run.whole:
                break
            left -= run.seconds
            found.append((setting, run.result))
        if len(found) > 1:
            own = errors(runner.ready.robot, found[-2][1], found[-1][1])["error"]
            return *found[-1], max(own, 2.0**-53)
    raise HybridynError(
        "no reference: two runs by dopri5 or the implicit method must finish. Simulate only the beginning "
        "(--until), or give more time (--seconds)"
    )


def _elsewhere(study: Study, runner: Runner, target: float) -> None:
    """Run the advised setting on a second motion, and fill in its error there."""
    best = cheapest(study, target)
    if best is None:
        return
    end = runner.exact.state
    runner.start = end.q, SLOWER * end.v
    try:
        exact, run = (
            runner.run(one, np.inf).result
            for one in (runner.reference, runner.tried[best.line, best.setting])
        )
        error = errors(runner.ready.robot, run, exact)["error"]
    except HybridynError as failure:
        study.remarks.append(f"{study.second}: {failure}")
        return
    study.points[study.points.index(best)] = replace(best, elsewhere=error)


def _worth(study: Study, runner: Runner, seconds: float) -> None:
    """Measure what each effect changes: those of the scene if left out, those of the files if added."""
    robot, on, dtype = runner.ready.robot, runner.ready.effects, runner.reference.dtype
    stated, every = choose(robot, "model"), operations(robot, on, "ddm")
    setting = setting_of(runner.reference.options["method"], OF_EFFECTS if dtype else SLOWLY, dtype)
    own = runner.run(setting, seconds)
    end = clock.perf_counter() + seconds - own.seconds
    for name in DROPPABLE:
        left = end - clock.perf_counter()  # of a first run, building C takes most
        if name not in {*on.names, *stated.names}:
            continue
        if left <= 0 or not own.whole:
            study.remarks.append(f"effects from {name} on were not tried: --seconds gives more time")
            return
        computed = name in on.names
        other = on.only([x for x in on.names if x != name]) if computed else _with(on, stated, name)
        try:
            run = runner.run(setting, left, effects=other)
        except HybridynError as error:
            study.remarks.append(f"{name}: {error}")
            continue
        if run.whole:
            share = operations(robot, other, "ddm") / every - 1.0
            change = errors(robot, run.result, own.result)["error"]
            study.worth.append(Worth(name, change, -share if computed else share, computed))


def _with(on: Effects, stated: Effects, name: str) -> Effects:
    """Return effects with one more, as the robot's files state it."""
    more = stated.only([name])
    return replace(
        on, leg_inertia=on.leg_inertia or more.leg_inertia, velocity=on.velocity or more.velocity,
        joints=(*on.joints, *more.joints), rotors=(*on.rotors, *more.rotors),
        names=tuple(unit for unit in UNITS if unit in {*on.names, name}),
    )  # fmt: skip


def needed_effects(study: Study, ready: Stage, target: float) -> list[str]:
    """Return lines that request the effects that a scene needs for an error, if it names others.

    Effects are left out, the least important first, as long as their changes together stay below the target.
    """
    needed = {one.effect for one in study.worth if not one.computed and one.error > target}
    spent, gone = 0.0, set()
    for one in sorted((one for one in study.worth if one.computed), key=lambda one: one.error):
        spent += one.error
        if spent <= target:
            gone.add(one.effect)
    if not needed and not gone:
        return []
    names = [name for name in UNITS if name in {*ready.effects.names, *needed} - gone]
    return effects_fragment(ready.source, names).split("\n")
