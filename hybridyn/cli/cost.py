"""`hybridyn cost`: measure what accuracy costs in time, for one robot and its motion."""

from __future__ import annotations

import math
import os
import sys
import textwrap
import time
from collections.abc import Callable
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import click

from ..studies.cost.points import ADVISED, SECONDS, Study, advice, cheapest, error_words, fronts
from .common.figures import figure_file, save
from .common.files import complete_data, complete_robot, existing_file, robot_file, scene_file
from .common.options import RobotChoice, RobotCommand
from .common.report import report_file, write_report
from .common.text import aligned_rows

if TYPE_CHECKING:
    from ..studies.cost.points import Point

#: Number of characters of a failure that are printed; the CSV file has all.
WIDTH = 120

#: Most rows of the front that are printed.
MOST_ROWS = 12

#: What is computed along a trajectory, the usual one first.
QUANTITIES = ("idm", "ddm", "close", "idm_jacobian", "ddm_jacobian")

#: Exit status after Ctrl-C.
INTERRUPTED = 130


def _source(ctx: click.Context, param: click.Parameter, value: str) -> str:
    """Return the file of a scene or robot; both may be shipped ones, given by name."""
    return (scene_file if value.endswith(".toml") else robot_file)(ctx, param, value)


def _target(ctx: click.Context, param: click.Parameter, value: float | None) -> float | None:
    """Check that a target is positive and finite."""
    if value is not None and not (math.isfinite(value) and value > 0):
        raise click.BadParameter(f"{value:g} is no error: give a number above zero, as 1e-3", ctx, param)
    return value


def _names(ctx: click.Context, param: click.Parameter, value: str) -> tuple[str, ...]:
    """Return names that stand between commas."""
    return tuple(filter(None, (name.strip() for name in value.split(","))))


@click.command(
    "cost",
    cls=RobotCommand,
    robot=click.Argument(["robot"], callback=_source, metavar="ROBOT|SCENE", shell_complete=complete_robot),
    short_help="Measure what accuracy costs in time, for your robot.",
)
@click.argument("trajectory", required=False, callback=existing_file, shell_complete=complete_data)
@click.option(
    "--target",
    type=float,
    callback=_target,
    help="Print only the fastest setting with this error, as lines for a scene; exit status 1 if none.",
)
@click.option(
    "--quantity", type=click.Choice(QUANTITIES), default=QUANTITIES[0], show_default=True,
    help="What is computed along a trajectory.",
)  # fmt: skip
@click.option(
    "--with", "engines", metavar="NAMES", default="", callback=_names,
    help="Engines whose settings are swept, too: pinocchio,mujoco. They compute rigid bodies alone.",
)  # fmt: skip
@click.option("--all", "every", is_flag=True, help="Print every setting, not only those worth having.")
@click.option(
    "--seconds", type=click.FloatRange(0, min_open=True), default=SECONDS, show_default=True,
    help="Time that the runs of a scene take together [s], besides building C.",
)  # fmt: skip
@click.option(
    "--until", type=click.FloatRange(0, min_open=True), help="Simulate a scene to this time [s] only."
)
@click.option("--allow-python", is_flag=True, help="Let the scene run the Python controller that it names.")
@click.option(
    "-o",
    "--output",
    metavar="FILE",
    callback=report_file,
    help="Write all measurements, .csv or .json.",
)
@click.option(
    "--plot", metavar="FILE", callback=figure_file, help="Error against time as a figure: .png, .svg or .pdf."
)
def command(
    load: RobotChoice,
    trajectory: str | None,
    target: float | None,
    quantity: str,
    engines: tuple[str, ...],
    every: bool,
    seconds: float,
    until: float | None,
    allow_python: bool,
    output: str | None,
    plot: str | None,
) -> int:
    """Measure what accuracy costs in time: 'cost ROBOT TRAJECTORY' or 'cost SCENE'.

    The command measures error and time of settings, and what each effect is worth. For a robot and a
    trajectory the settings are compiled or general path, float32 or float64, batch or single calls, effects,
    and the source of rates. For a scene they are methods, steps and tolerances. Errors are relative to a
    reference, whose own error is shown. Times are measured on this machine. Ctrl-C prints what was measured.
    """
    from ..description.shipped import own_trajectory

    source = load.robot
    scene = source.endswith(".toml")
    if not scene and trajectory is None:
        trajectory = own_trajectory(source)
    given = trajectory is not None and trajectory.lower().endswith(".toml")
    for wrong, said in (
        (given, f"'{trajectory}' is a scene, which names its robot: 'hybridyn cost {trajectory}'"),
        (
            scene and trajectory is not None,
            f"a scene has its own motion: 'hybridyn cost {source}', without '{trajectory}'",
        ),
        (
            not scene and trajectory is None,
            "give a robot and a trajectory, or a scene alone (a .toml file)",
        ),
        (scene and load != RobotChoice(source), "the robot's options stand in the scene: leave them out"),
        (not scene and (until or allow_python), "--until and --allow-python are for scenes"),
        (
            scene and (engines or quantity != QUANTITIES[0]),
            "--with and --quantity are for a robot and a trajectory: 'hybridyn cost ROBOT TRAJECTORY'",
        ),
    ):
        if wrong:
            raise click.UsageError(said)
    study, status, lines = Study("", "per run" if scene else "per sample"), 0, list[str]()
    try:
        if scene:
            lines = _scene(study, source, (until, seconds, target), allow_python, _shown(study))
        else:
            _robot(study, load, str(trajectory), _shown(study), quantity, engines, target)
    except KeyboardInterrupt:
        status = INTERRUPTED
        study.remarks.append("stopped by Ctrl-C: what follows was not measured")
        if not study.points:
            raise
    if output:
        write_report(output, _rows(study))
    if plot:
        from ..figures.cost import figure_of

        save(figure_of(study, os.path.basename(source)), plot)
    return _tell(study, target, lines, every=every) or status


def _shown(study: Study) -> Callable[[Point], None]:
    """Return a function that prints each point when it is measured, if a person looks."""
    started = time.perf_counter()

    def show(point: Point) -> None:
        """Print a point on standard error."""
        if sys.stderr.isatty():
            told = point.failure or f"{point.error:.1e} in {_time(point.seconds)}"
            text = f"{time.perf_counter() - started:4.0f} s  {point.line}, {point.setting}: {told}"
            click.echo(textwrap.shorten(text, WIDTH), err=True)

    return show


def _robot(
    study: Study, load: RobotChoice, trajectory: str, progress: Callable[[Point], None], quantity: str,
    engines: tuple[str, ...], target: float | None,
) -> None:  # fmt: skip
    """Measure a robot on a trajectory, with every effect that its files state, or those that engines have."""
    from ..effects import choose
    from ..errors import TrajectoryError
    from ..streams.one_pass import read_postures
    from ..studies.cost.models import Trajectory, study_models

    robot = load()
    layout, (motion, q, v, a) = read_postures(robot, trajectory)
    if motion.wrenches:
        raise TrajectoryError(
            f"has wrenches ({', '.join(map(repr, motion.wrenches))}), which 'cost' does not measure: leave "
            "their columns out",
            file=trajectory,
        )
    table = None if layout.full_state or motion.time is None else motion
    study_models(
        robot, Trajectory(q, v, a, motion.time, table), choose(robot, None if engines else "model"), progress,
        study, quantity=quantity, engines=engines, target=target or ADVISED,
    )  # fmt: skip


def _scene(
    study: Study, source: str, bounds: tuple[float | None, float, float | None], allow_python: bool,
    progress: Callable[[Point], None],
) -> list[str]:  # fmt: skip
    """Measure a scene; return lines that request the effects that it needs."""
    from ..errors import TrajectoryError
    from ..scenes.stage import stage
    from ..studies.cost.runs import needed_effects, study_runs

    ready = stage(source, allow_python=allow_python)
    if ready.motion is not None:
        raise TrajectoryError(
            "the scene's motion is given: nothing is integrated. Try 'hybridyn cost ROBOT TRAJECTORY'",
            file=source,
        )
    until, seconds, target = bounds
    duration = ready.source.scene.duration
    study_runs(ready, min(duration, until or duration), progress, seconds, study, target or ADVISED)
    return needed_effects(study, ready, target or ADVISED)


def _tell(study: Study, target: float | None, lines: list[str], *, every: bool) -> int:
    """Print the table or, with a target, the lines for a scene; return the exit status."""
    if target is None:
        for line in _report(study, lines, every=every):
            click.echo(line)
        return 0
    sentence, best = advice(study, target), cheapest(study, target)
    if best is None:
        click.echo(f"error: {sentence}", err=True)
        return 1
    click.echo("\n".join([f"# {sentence}", best.fragment, *lines]))
    return 0


def _report(study: Study, needed: list[str], *, every: bool) -> list[str]:
    """Return the advice, the settings worth having, and what effects are worth."""
    own, others = fronts(study)
    worth = [*own[len(others) - MOST_ROWS :], *others]
    per_sample = study.time_unit == "per sample"
    shown = [p for p in study.points if not p.failure and (every or p in worth or p.use == "usual")]
    rows = [["", "choice", "setting", "error", f"time {study.time_unit}", ""]]
    for p in sorted(shown, key=lambda p: p.seconds):
        mark = "-" if p.use == "comparison" else "*" if p in own else ""
        rows.append([mark, p.line, p.setting, error_words(p, study), _time(p.seconds), p.how])
    lines = [advice(study, ADVISED), "", study.question, *aligned_rows(rows, right=(3, 4))]
    if every:
        lines += _failures(study)
        lines.append("* nothing else is both faster and more accurate")
    if study.worth:
        lines += ["", *_effects(study, "along this motion" if per_sample else "in this scene")]
    if needed:
        lines += ["", f"effects for {ADVISED:g}, in the scene:", *needed]
    lines += [
        "",
        f"errors are against {study.reference} (its own error: {study.own_error:.0e})",
        *(textwrap.shorten(remark, 2 * WIDTH, placeholder=" ...") for remark in study.remarks),
    ]
    left = len(study.points) - len(shown)
    return [*lines, f"{left} more settings were measured: --all shows them"] if left else lines


def _effects(study: Study, where: str) -> list[str]:
    """Return a table of what effects are worth."""
    rows = [[f"effect, {where}", "changes", "takes", ""]]
    for one in sorted(study.worth, key=lambda one: -one.error):
        matters = one.error > ADVISED
        word = ("" if one.computed else "add it") if matters else ("leave it out" if one.computed else "")
        share = "" if math.isnan(one.share) else f"{100 * one.share:.2g} %"
        rows.append([one.effect.replace("_", " "), f"{one.error:.1e}", share, word])
    return aligned_rows(rows, right=(1, 2))


def _failures(study: Study) -> list[str]:
    """Return lines that name settings without a result and the reason."""
    found = (f"{p.line}, {p.setting}: {p.failure}" for p in study.points if p.failure)
    return [f"no result: {textwrap.shorten(line, WIDTH, placeholder=' ...')}" for line in found]


def _time(seconds: float) -> str:
    unit, factor = ("us", 1e6) if seconds < 1e-2 else ("s", 1.0)
    return f"{seconds * factor:.3g} {unit}"


def _rows(study: Study) -> list[dict[str, Any]]:
    """Return the settings, and what each effect is worth, as rows of a report."""
    worth = fronts(study)[0]
    rows = [asdict(p) | {"on_front": p in worth} for p in study.points]
    rows += [{"line": "effect", "setting": one.effect, **one._asdict()} for one in study.worth]
    return [
        {k: None if isinstance(x, float) and not math.isfinite(x) else x for k, x in row.items()}
        for row in rows
    ]
