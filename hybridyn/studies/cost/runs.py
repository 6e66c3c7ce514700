"""Measure error and time of a scene's integration: method, step or tolerance, compiled or not, effects.

Accelerations are compiled. The general path takes a hundred times as long: it runs for a short time only, and
its time is extrapolated. So is that of any run that takes too long; its error at the end is not known. Errors
are judged by a run with many outputs, times by runs with the last one alone. Models are built of the scene's
effects, of these without or with each other effect, of every effect that is stated, and of those that are
needed.
"""

from __future__ import annotations

import contextlib
import logging
import time as clock
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from ...compiled.compiling import compile
from ...dynamics.direct import ddm
from ...effects.choice import UNITS, Effects, choose, stated_names
from ...errors import HybridynError
from ...scenes.scene_file import SceneFile
from ...scenes.stage import SceneStage
from ...simulation.result import SimulationResult
from ...simulation.simulate import simulate
from ...spatial import Array
from ...structure.robot import HybridRobot
from ..compare.methods import written
from .points import (
    ADVISED,
    SECOND,
    SECONDS,
    SLOWER,
    CostPoint,
    CostStudy,
    Progress,
    Step,
    Use,
    Worth,
    cheapest,
    fill,
)
from .variants import Trajectory, operations, requested, spared, worded

#: Fixed steps relative to the mean step of the scene's own solver.
FACTORS = (8.0, 4.0, 2.0, 1.0, 0.5)
#: Relative tolerances of the adaptive methods.
TOLERANCES = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10)
#: Relative tolerances: of the run that finds the end, and of those that lead to the reference.
FIRST, LADDER = 1e-6, (1e-8, 1e-10, 1e-11, 1e-12)
#: Methods with fixed steps.
FIXED = ("rk4", "conserving")
#: Effects that a scene requests only by tables of their own.
TABLES = ("payload", "wrench", "base_motion")
#: Effects that can be left out without changing the task of a scene.
DROPPABLE = (
    "leg_inertia", "velocity", "rotor_inertia", "viscous_friction", "coulomb_friction", "stribeck_friction",
)  # fmt: skip

#: Number of repetitions of a short run, and the longest time of such a run [s].
ROUNDS, SHORT = 2, 0.3
#: Part of a time that the first run takes at most. Where it is stopped, the scene is as many times as short,
#: since tighter tolerances take longer.
SHORTER = 4.0
#: Times at which postures are compared, as parts of a run: an error between two of them shows at both. The
#: general path interpolates slowly: without compiled models, each of so many is taken.
OUTPUTS, SPARSE = np.linspace(0.0, 1.0, 201), 8
#: Part of a scene that is run before anything is timed.
BEGINNING = 1e-6
#: Parts of `SECONDS`: for one family of settings, for the reference, and for each effect.
ONE_FAMILY, REFERENCE, ONE_EFFECT = 1 / 16, 1 / 10, 1 / 20
#: Relative tolerance of the runs that show what effects are worth: their changes matter from 1e-3 on.
OF_EFFECTS = 1e-8

#: The outputs of a run so far, and its computing time [s].
Run = tuple[SimulationResult, float]


class Setting(NamedTuple):
    """One setting of the solver.

    Attributes:
        options: Arguments of `simulate`.
        line: Family that it belongs to.
        use: As in `CostPoint`.
        compiled: Whether accelerations are computed in C.
    """

    options: dict[str, Any]
    line: str
    use: Use = "command"
    compiled: bool = True

    @property
    def words(self) -> str:
        """What distinguishes it within its family."""
        pace = "step" if self.options["method"] != "dopri5" and "step" in self.options else "rtol"
        words = written({pace: self.options[pace]})
        return f"{self.options['method']}, {words} (usual)" if self.use == "usual" else words

    @property
    def fragment(self) -> str:
        """The table [solver] that replaces the scene's own, and the option of the command."""
        engine = "compiled" if self.compiled else "general"
        numbers = [f"{name} = {x:g}" for name, x in self.options.items() if name != "method"]
        lines = ["[solver]", f'method = "{self.options["method"]}"', *numbers]
        return "\n".join([*lines, f"# hybridyn simulate --engine {engine}"])


def setting_of(method: str, pace: float, compiled: bool) -> Setting:
    """Return the setting of a method at a step [s] or at a relative tolerance."""
    paces = {"step": pace} if method in FIXED else {"rtol": pace, "atol": pace * 1e-2}
    return Setting({"method": method} | paces, method, compiled=compiled)


def effects_fragment(source: SceneFile, names: Sequence[str]) -> str:
    """Write the table [effects] that requests some of the scene's effects."""
    own = {name for name in source.scene.effects.stated() if name in UNITS}
    use = [name for name in names if name not in own and name not in TABLES]
    gone = sorted(own - set(names) - set(TABLES))
    return "\n".join([requested(use), *(f"# without the table [effects.{name}]" for name in gone)])


class Runner:
    """Runs one scene with any setting.

    Attributes:
        ready: The scene.
        duration: Time to simulate [s].
        start: Positions and rates at the start.
        compiled: Whether there are compiled models.
        came: How far the last run came [s].
        reference, exact, own_error: Setting and run of the reference, and its error.
        near: The looser settings that led to the reference, with their runs, until they are measured.
    """

    def __init__(self, ready: SceneStage, duration: float) -> None:
        self.ready, self.duration, self.start, self.compiled = ready, duration, (ready.q0, ready.v0), True
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
            found, _ = self.run(setting_of("dopri5", OF_EFFECTS, self.compiled), limit, effects=effects)
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
                self.duration = BEGINNING * whole
                self.run(setting_of(method, FIRST, self.compiled), np.inf)  # builds and loads what it needs
                self.duration = whole
                first, _ = self.run(setting_of(method, FIRST, self.compiled), limit / SHORTER, watch=True)
                self.duration = float(first.state.t) / (1.0 if first.status != "interrupted" else SHORTER)
                for setting in (setting_of(method, rtol, self.compiled) for rtol in LADDER):
                    run, seconds = self.run(setting, limit)
                    if run.status == "interrupted":
                        break
                    found.append((setting, (run, seconds)))
                    if len(found) > 1 and seconds > limit / SHORTER:
                        break
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


def states_of(ready: SceneStage, duration: float, effects: Effects) -> Trajectory:
    """Return the states of a scene, and the accelerations there under its efforts with some effects."""
    run = simulate(
        ready.robot, ready.q0, ready.v0, (0.0, duration), effort=ready.effort, effects=ready.effects,
        compiled=compile(ready.robot, ready.effects, wait=True), events=ready.events, rtol=OF_EFFECTS,
    )  # fmt: skip
    return Trajectory(run.q, run.v, ddm(ready.robot, run.q, run.v, run.tau, effects=effects), run.t)


def study_runs(
    ready: SceneStage,
    duration: float,
    progress: Progress = lambda result: None,
    seconds: float = SECONDS,
    study: CostStudy | None = None,
    target: float = ADVISED,
) -> CostStudy:
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
    try:
        compile(ready.robot, ready.effects, wait=True)
    except HybridynError as error:  # effects of time and of contact cannot be compiled
        runner.compiled = False
        study.remarks.append(f"no compiled models: {error}")
    first = runner.find_reference(seconds * REFERENCE)
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

    options = ready.source.scene.solver.model_dump(exclude_none=True)
    usual = Setting(options, "as the scene says", "usual", runner.compiled)
    mean = runner.duration * min(1.0 / first.counters.steps, 0.9 / FACTORS[0])
    step = (options["method"] != "dopri5" and options.get("step")) or float(f"{mean:.1g}")
    paces = [float(f"{factor * step:g}") for factor in FACTORS]
    quick, *others = (
        [setting_of(method, pace, runner.compiled) for pace in (paces if method in FIXED else TOLERANCES)]
        for method in ("dopri5", "rk4", "conserving", "implicit")
    )
    near, general = [one for one, _ in runner.near.values()], Setting(options, "general path", compiled=False)
    tried, every = dict[str, Setting](), every_effect(ready)
    steps: list[Step] = [
        (family[0].line, _family(runner, family, tried, limit))
        for family in (near, quick, [usual], [general], *others)
    ]
    steps.append(("effects", _worth(runner, every, seconds * ONE_EFFECT)))
    fill(study, steps, progress)
    if needed := needed_effects(study, ready, every, target):
        study.kept, said = _checked(runner, every, needed, target, limit)
        study.needed = [effects_fragment(ready.source, study.kept), *(f"# {line}" for line in said)]
    if best := cheapest(study, target):
        _elsewhere(study, runner, best, tried[best.fragment])
    return study


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


def _worth(runner: Runner, every: Effects, limit: float) -> Iterator[Worth]:
    """Measure what each effect changes at the end: those of the scene if left out, others if added.

    Args:
        every: The effects that act in the scene, or would by the robot's files.
        limit: Time of a run [s].

    Raises:
        HybridynError: The scene takes longer.
    """
    robot, on = runner.ready.robot, runner.ready.effects
    exact, whole = runner.whole(limit, on), operations(robot, on, "ddm")
    for name in (name for name in DROPPABLE if name in every.names):
        computed = name in on.names
        other = on.without(name) if computed else every.only([*on.names, name])
        share = operations(robot, other, "ddm") / whole - 1.0
        try:
            change = errors(robot, runner.whole(2.0 * limit, other), exact)["error"]
        except HybridynError:  # a motion without mass
            change = np.inf
        yield Worth(name, change, -share if computed else share, computed)


def _checked(
    runner: Runner, every: Effects, needed: list[str], target: float, limit: float
) -> tuple[list[str], list[str]]:
    """Run the effects that seem needed and those of the scene against every effect.

    Returns:
        The effects that are needed: every effect, where fewer miss the target. And how far the ends are
        from that with every effect, in words.
    """
    robot, run = runner.ready.robot, partial(runner.whole, limit)
    gone = [name for name in every.names if name not in needed]
    sets = {f"without {worded(gone)}": every.only(needed)} if gone else {}
    sets["with those of the scene"] = runner.ready.effects
    try:
        exact = run(every)
        away = {words: errors(robot, run(on), exact)["error"] for words, on in sets.items()}
        said = [
            f"{words}, the end is {error:.1e} from that with every effect that is stated"
            for words, error in away.items()
        ]
        if not gone:
            return needed, said
        if away[f"without {worded(gone)}"] > target:
            return [*every.names], said
        runner.start = exact.state.q, SLOWER * exact.state.v
        elsewhere = errors(robot, run(every.only(needed)), run(every))["error"]
        if elsewhere > target:
            said.append(
                f"these do not carry over to {SECOND['per run']}: there the end is {elsewhere:.1e} away"
            )
        return needed, said
    except HybridynError as failure:
        return needed, [f"not compared with every effect that is stated: {failure}"]


def every_effect(ready: SceneStage) -> Effects:
    """Return the effects of a scene with those of `DROPPABLE` that the robot's files state besides.

    Those of `DROPPABLE` that take no operations act on nothing, as rotors of a robot without: they are left
    out.
    """
    robot, on = ready.robot, ready.effects
    stated = choose(robot, ["default", *stated_names(robot)])
    more = stated.only([name for name in DROPPABLE if name not in on.names])
    every = replace(
        on, leg_inertia=on.leg_inertia or more.leg_inertia, velocity=on.velocity or more.velocity,
        joints=(*on.joints, *more.joints), rotors=(*on.rotors, *more.rotors),
    )  # fmt: skip
    every = replace(every, names=every.named({*on.names, *more.names}))
    whole = operations(robot, every, "ddm")
    some = [name for name in DROPPABLE if name in every.names]
    return every.without(*(name for name in some if operations(robot, every.without(name), "ddm") == whole))


def needed_effects(study: CostStudy, ready: SceneStage, every: Effects, target: float) -> list[str]:
    """Return the effects that a scene needs for an error, or nothing if it names them.

    Effects are left out, the least important first, as long as their changes together stay below the target.

    Args:
        every: As `every_effect` returns them.
    """
    more = [one.effect for one in study.worth if not one.computed and one.error > target]
    worth = {one.effect: one.error for one in study.worth}
    gone = spared(study.worth, target, lambda names: sum(worth[name] for name in names))
    if not more and not gone:
        return []
    return [*every.only({*ready.effects.names, *more} - {*gone}).names]
