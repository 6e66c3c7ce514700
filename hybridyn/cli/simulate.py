"""`hybridyn simulate`: simulate a scene and write the table of its motion."""

import contextlib
import itertools
import math
import os
import signal
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import click
import numpy as np

from ..errors import TrajectoryError
from ..figures.motion import chart_of_rows
from ..scenes.scene_file import read_scene
from ..scenes.stage import SceneStage, files_of, identity, play, stage
from ..scenes.toml_source import naming
from ..simulation.result import SimulationResult
from ..simulation.stepping import SHORTEST
from ..simulation.table import columns_of, picked, rows_of
from ..streams.departures import Departures, departures
from ..tables.results import check_target, open_results
from .common.engine_choice import WORTH_OF_POSTURES, EngineChoice, choose_engine, worth_in_time
from .common.figures import save, title_of
from .common.files import check_targets
from .common.options import refuse
from .common.progress import progress
from .common.summary import effects_line
from .common.text import counted

FAILED = ("unreachable", "unsolved", "singular")
#: Number of steps of the trial run that estimates the length of steps.
TRIAL = 12
#: Time of an evaluation with computed torque on the general path, in those of the direct model alone.
WITH_INVERSE_MODEL = 3
#: Number of rows that are written together.
AT_ONCE = 4096


def run(
    scene: str,
    output: str | None,
    until: float | None,
    resume: bool,
    overwrite: bool,
    allow_python: bool,
    engine: str | None,
    plot: str | None,
    quiet: bool,
    strict: bool,
) -> int:
    """Simulate a scene, write the table, and return the exit status."""
    started = time.perf_counter()
    ready = stage(read_scene(scene, strict=strict), allow_python=allow_python)
    target = output or _own_target(ready)
    state = _state_of(ready, target, resume=resume, overwrite=overwrite)
    check_targets(files_of(ready.source), (target, state, plot))
    chosen = _engine(ready, engine)
    with _between_steps(until) as (after_step, stop):
        result = play(
            ready,
            progress=after_step,
            checkpoint=state,
            resume=state if resume else None,
            compiled=chosen.model,
        )
    if chosen.model is not None:
        chosen.handed_over = chosen.model.recomputed
    _write(ready, result, target, plot)
    if state is not None and result.status != "interrupted":  # after an error it would come to the same
        Path(state).unlink(missing_ok=True)
    if not quiet:
        for line in _summary(ready, result, chosen, time.perf_counter() - started):
            click.echo(line, err=True)
    return _finish(result, scene, target, state, stopped=bool(stop))


def _engine(ready: SceneStage, asked: str | None) -> EngineChoice:
    """Choose the engine that computes the accelerations."""
    evaluations = _evaluations(ready) if asked is None else None
    controller = ready.source.scene.controller
    if evaluations is not None and controller is not None and controller.kind == "computed_torque":
        evaluations *= WITH_INVERSE_MODEL
    freedoms = ready.robot.nv
    worth = worth_in_time(freedoms) if ready.motion is None else WORTH_OF_POSTURES * freedoms
    alone = ready.motion is None
    return choose_engine(asked, ready.robot, ready.effects, evaluations, worth, {}, alone=alone)


def _evaluations(ready: SceneStage) -> int:
    """Estimate the number of evaluations of the direct model, from fixed steps or from a short trial run."""
    scene = ready.source.scene
    solver, controller = scene.solver, scene.controller
    rows = 0 if ready.output_times is None else len(ready.output_times)
    if solver.step and solver.method in ("rk4", "implicit"):
        return math.ceil(4 * scene.duration / solver.step)
    of_others = controller is not None and controller.kind not in ("efforts", "pd", "computed_torque")
    if of_others or ready.motion is not None or solver.method == "conserving":
        return rows
    steps = itertools.count(1)

    def stop(t: float, end: float) -> None:
        """End the trial run after its steps."""
        if next(steps) == TRIAL:
            raise KeyboardInterrupt

    trial = play(replace(ready, output_times=np.array([scene.duration]), events=()), progress=stop)
    each = trial.counters.evaluations / max(trial.counters.steps, 1)
    return rows + math.ceil(each * scene.duration / max(abs(trial.next_step), scene.duration * SHORTEST))


def _own_target(ready: SceneStage) -> str | None:
    """Return the result file that the scene names, or None."""
    name = ready.source.scene.output.file
    if name is None:
        return None
    target = ready.source.beside(name)
    folder = Path(os.path.realpath(ready.source.file)).parent
    with naming(ready.source, ("output", "file")):
        if not Path(os.path.realpath(target)).is_relative_to(folder):
            raise TrajectoryError(f"'{name}' lies outside the scene's folder; name it with -o instead")
        check_target(target)
    return target


def _state_of(ready: SceneStage, target: str | None, *, resume: bool, overwrite: bool) -> str | None:
    """Return the file of the state of a run into a file, None where there is none; check it."""
    if target is None or target == "-" or ready.motion is not None:
        refuse((resume, "--resume continues the run in a result file: name it with -o"))
        return None
    state = f"{target}.state"
    # a scene's folder may have come with it
    refuse((os.path.islink(state), f"'{state}' is a link, whose file would be replaced: remove the link"))
    if resume and not os.path.exists(state):
        raise TrajectoryError(
            "there is no '.state' file beside it: the run is finished, ended with an error, or was not begun "
            "here", file=target,
        )  # fmt: skip
    if os.path.exists(state) and (resume or not overwrite):
        _check_continues(ready, state, target, resume=resume)
    return state


def _check_continues(ready: SceneStage, state: str, target: str, *, resume: bool) -> None:
    """Refuse a run into the file of one that was stopped, unless it continues that with the same scene."""
    try:
        same = SimulationResult.load(state).origin.scene == identity(ready.source)
    except TrajectoryError:
        if resume:
            raise
        same = False
    changed = f"was not begun with this scene as it stands in '{ready.source.file}' now"
    if resume and not same:
        raise TrajectoryError(f"{changed}: --overwrite begins anew", file=state)
    how = ": --resume continues it, " if same else f" and {changed}: "
    refuse((not resume, f"'{target}' holds a run that was stopped{how}--overwrite begins anew"))


@contextlib.contextmanager
def _between_steps(until: float | None) -> Iterator[tuple[Callable[[float, float], None], list[int]]]:
    """Yield what a run calls after each step, and a list to which Ctrl-C appends.

    The run is shown, and stops between steps, on Ctrl-C and at a time [s]; a second Ctrl-C stops it at once.
    """
    marks: list[int] = []

    def after_step(t: float, end: float) -> None:
        """Show how far the run is, and stop it."""
        show(round(1e3 * t), t / end)
        if marks or t >= (until or math.inf):
            raise KeyboardInterrupt

    def mark(number: int, frame: object) -> None:
        """Note the first Ctrl-C; the second ends the program."""
        marks.append(number)
        signal.signal(signal.SIGINT, signal.default_int_handler)

    with progress("ms") as show, contextlib.ExitStack() as after:
        with contextlib.suppress(ValueError):  # signals can be handled in the main thread only
            after.callback(signal.signal, signal.SIGINT, signal.signal(signal.SIGINT, mark))
        yield after_step, marks


def _write(ready: SceneStage, result: SimulationResult, target: str | None, plot: str | None) -> None:
    """Write the table of the motion, and its figure."""
    columns, rows = columns_of(ready.robot), rows_of(ready.robot, result)
    with naming(ready.source, ("output", "columns")):
        chosen = picked(columns, ready.source.scene.output.columns)
    with open_results(target, [columns[i] for i in chosen]) as write:
        for first in range(0, len(rows), AT_ONCE):  # the text of a number takes many times its memory
            write(rows[first : first + AT_ONCE, chosen])
    if plot and len(rows):
        title = title_of(ready.robot, str(ready.source.file))
        save(chart_of_rows(columns, result.t, rows, robot=ready.robot, title=title), plot)


def _summary(ready: SceneStage, result: SimulationResult, engine: EngineChoice, wall: float) -> list[str]:
    counters = result.counters
    reached = result.t[-1] if ready.motion is not None and len(result.t) else result.state.t
    lines = [
        f"{ready.robot.name}, base {ready.robot.base}: {ready.source.scene.duration:g} s by {result.method}, "
        f"reached {reached:g} s"
    ]
    lines += [f"event: {event.name} at {event.t:.6g} s" for event in result.events]
    if len(result.t):
        peak = float(result.kinetic.max())
        change = result.energy - result.energy[0]
        lines.append(
            f"energy: peak kinetic {peak:.6g} J; total {result.energy[0]:.6g} J at first, changed by at most "
            f"{float(abs(change).max()):.3g} J"
        )
        if ready.robot.description.closures or ready.robot.description.couplings:
            lines.append(f"worst closure residual: {float(result.residual.max()):.2g} of the module's size")
    left = Departures()
    left.add(departures(ready.robot, result.q, result.v, result.tau), 1, result.t)
    lines += [*left.lines(), effects_line(ready.robot, ready.effects), str(engine)]
    steps = f"{counted(counters.steps, 'step')} ({counters.rejected:,} rejected), "
    done = "" if ready.motion is not None else f"{steps}{counted(counters.evaluations, 'evaluation')}, "
    return [*lines, f"{done}{counted(len(result.t), 'row')}, wall time {wall:.2f} s"]


def _finish(
    result: SimulationResult, scene: str, target: str | None, state: str | None, *, stopped: bool
) -> int:
    """Print how to continue a run that was stopped, and return the exit status."""
    if result.status in FAILED:
        click.echo(f"error: {scene}: {result.status} {result.message}", err=True)
        return 1
    if result.status == "interrupted":
        how = (
            f"go on with: hybridyn simulate {scene} --resume -o {target}"
            if state is not None
            else "to be able to go on, give a result file (-o)"
        )
        click.echo(f"stopped {result.message}; {how}", err=True)
        return 130 if stopped else 0
    return 0
