"""Measure error and time of a scene's integration: method, step or tolerance, compiled or not, effects.

Accelerations are compiled. The general path takes a hundred times as long: it runs for a short time only, and
its time is extrapolated. So is that of any run that takes too long; its error at the end is not known. Errors
are judged by a run with many outputs, times by runs with the last one alone. Models are built of the scene's
effects, of these without or with each other effect, of every effect that is stated, and of those that are
needed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from ...compiled import compile
from ...dynamics.direct import ddm
from ...effects.choice import Effects
from ...errors import HybridynError
from ...scenes.stage import SceneStage
from ...simulation.result import SimulationResult
from ...simulation.simulate import simulate
from .measured import Trajectory
from .points import ADVISED, SECONDS, SLOWER, CostPoint, CostStudy, Progress, Step, cheapest, fill
from .runner import OF_EFFECTS, OUTPUTS, Runner, errors, way_off
from .scene_effects import checked_together, effects_fragment, every_effect, needed_effects, worth_at_end
from .solver_settings import FIXED, Setting, setting_of

#: Fixed steps relative to the mean step of the scene's own solver.
FACTORS = (8.0, 4.0, 2.0, 1.0, 0.5)
#: Relative tolerances of the adaptive methods.
TOLERANCES = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10)

#: Number of repetitions of a short run, and the longest time of such a run [s].
ROUNDS, SHORT = 2, 0.3
#: Parts of `SECONDS`: for one family of settings, for the reference, and for each effect.
ONE_FAMILY, REFERENCE, ONE_EFFECT = 1 / 16, 1 / 10, 1 / 20


def states_of(ready: SceneStage, duration: float, effects: Effects) -> Trajectory:
    """Return the states of a scene, and the accelerations there under its efforts with some effects."""
    on, sticks = ready.effects, ready.source.scene.solver.stiction
    run = simulate(
        ready.robot, ready.q0, ready.v0, (0.0, duration), effort=ready.effort, effects=on,
        compiled=None if on.uncompiled or sticks else compile(ready.robot, on, wait=True),
        events=ready.events, rtol=OF_EFFECTS, stiction=sticks,
    )  # fmt: skip
    return Trajectory(run.q, run.v, ddm(ready.robot, run.q, run.v, run.tau, effects=effects), run.t)


def _not_compiled(ready: SceneStage, runner: Runner) -> str:
    """Build the compiled models of a scene; return why it has none."""
    if runner.sticks:
        return "joints that stick are simulated on the general path"
    try:
        compile(ready.robot, ready.effects, wait=True)
    except HybridynError as error:  # effects of time, of contact, and losses that grow with load
        return str(error)
    return ""


def study_runs(
    ready: SceneStage, duration: float, progress: Progress = lambda result: None, seconds: float = SECONDS,
    study: CostStudy | None = None, target: float = ADVISED,
) -> CostStudy:  # fmt: skip
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
    study = CostStudy("", "per run") if study is None else study
    study.subject = "the last posture"
    runner, limit = Runner(ready, duration), seconds * ONE_FAMILY
    if why := _not_compiled(ready, runner):
        runner.compiled = False
        study.remarks.append(f"no compiled models: {why}")
    first = runner.find_reference(seconds * REFERENCE)
    _tell_reference(study, runner, first)
    tried, every = dict[str, Setting](), every_effect(ready)
    steps: list[Step] = [
        (family[0].line, _family(runner, family, tried, limit)) for family in _families(runner, first)
    ]
    steps.append(("effects", worth_at_end(runner, every, seconds * ONE_EFFECT)))
    fill(study, steps, progress)
    _advise_effects(study, runner, every, target, limit)
    if best := cheapest(study, target):
        _elsewhere(study, runner, best, tried[best.fragment])
    return study


def _advise_effects(study: CostStudy, runner: Runner, every: Effects, target: float, limit: float) -> None:
    """Say in the study which effects the scene needs, and how far the end is from that with every effect."""
    if needed := needed_effects(study, runner.ready, every, target):
        study.kept, said = checked_together(runner, every, needed, target, limit)
        study.needed = [effects_fragment(runner.ready.source, study.kept), *(f"# {line}" for line in said)]


def _tell_reference(study: CostStudy, runner: Runner, first: SimulationResult) -> None:
    """Say in the study what is asked, and what the answers are compared with."""
    if first.status == "interrupted":
        study.remarks.append(
            f"only the first {runner.duration:.3g} s are measured: --seconds gives more time"
        )
    study.question = (
        f"error of the last posture (after {runner.duration:.6g} s"
        f"{', where an event ends it' * (first.status == 'event')}) against time of the run"
    )
    study.own_error = runner.own_error
    study.reference = f"{runner.reference.line} at {runner.reference.words}"


def _families(runner: Runner, first: SimulationResult) -> list[list[Setting]]:
    """Return the settings by families, each from coarse to fine.

    Args:
        first: The run that found the end, whose steps say how long fixed ones may be.
    """
    options = runner.ready.source.scene.solver.model_dump(exclude_none=True)
    usual = Setting(options, "as the scene says", "usual", runner.compiled)
    mean = runner.duration * min(1.0 / first.counters.steps, 0.9 / FACTORS[0])
    step = (options["method"] != "dopri5" and options.get("step")) or float(f"{mean:.1g}")
    paces = [float(f"{factor * step:g}") for factor in FACTORS]
    quick, *others = (
        [
            setting_of(method, pace, runner.compiled, runner.sticks)
            for pace in (paces if method in FIXED else TOLERANCES)
        ]
        for method in ("dopri5", "rk4", *["conserving"] * (not runner.sticks), "implicit")
    )
    near, general = [one for one, _ in runner.near.values()], Setting(options, "general path", compiled=False)
    return [near, quick, [usual], [general], *others]


def _family(
    runner: Runner, family: list[Setting], tried: dict[str, Setting], left: float
) -> Iterator[CostPoint]:
    """Measure settings from coarse to fine, until one takes too long or is as exact as the reference.

    One that fails is followed by a finer one.

    Args:
        tried: Receives the settings, by their lines to paste.
        left: Time of the family [s].
    """
    for setting in (one for one in family if one.use == "usual" or one.fragment not in tried):
        try:
            run, seconds = runner.near.pop(setting.fragment, (setting, None))[1] or runner.run(setting, left)
            left -= seconds
            point = _point(runner, setting, run, seconds, left)
        except HybridynError:  # a step that is too long for the motion
            if setting is family[-1]:
                raise
            continue
        tried[setting.fragment] = setting
        yield point
        left -= seconds
        if point.how or left <= 0 or point.error <= runner.own_error:
            return


def _point(runner: Runner, setting: Setting, run: SimulationResult, seconds: float, left: float) -> CostPoint:
    """Return what a run shows of a setting, and take its time without outputs, where time is left [s]."""
    robot, how = runner.ready.robot, ""
    if run.status == "interrupted":
        part, away = float(run.state.t) / runner.duration, way_off(robot, run, runner.exact)
        seconds /= part
        so_far = f" (error so far {max(away):.1e})" if len(away) > 1 else ""
        how = f"the first {100 * part:.2g} % of the scene{so_far}, time extrapolated"
    elif seconds <= left:
        bare = partial(runner.run, setting, np.inf, outputs=OUTPUTS[-1:])
        seconds = min([seconds, *(bare()[1] for _ in range(ROUNDS if seconds < SHORT else 1))])
    words = f"take {setting.line}, {setting.words}"
    return CostPoint(
        setting.line, setting.words, seconds=seconds, fragment=setting.fragment,
        what="keep what the scene says" if setting.use == "usual" else words,
        use=setting.use, how=how, **errors(robot, run, runner.exact),
    )  # fmt: skip


def _elsewhere(study: CostStudy, runner: Runner, best: CostPoint, setting: Setting) -> None:
    """Run the advised setting on a second motion, and fill in its error there, infinite if a run fails."""
    runner.start = runner.exact.state.q, SLOWER * runner.exact.state.v
    try:
        exact, run = (runner.run(one, np.inf)[0] for one in (runner.reference, setting))
        error = errors(runner.ready.robot, run, exact)["error"]
    except HybridynError:
        error = np.inf
    study.points[study.points.index(best)] = replace(best, elsewhere=error)
