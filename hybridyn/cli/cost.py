"""`hybridyn cost`: measure what accuracy costs in time, for one robot and its motion."""

from __future__ import annotations

import csv
import io
import math
import os
import textwrap
from collections.abc import Callable
from typing import TYPE_CHECKING

import click

from .common.figures import figure_file, save
from .common.files import complete_data, complete_robot, existing_file, result_file, robot_file, scene_file
from .common.progress import Progress
from .common.text import aligned_rows

if TYPE_CHECKING:
    from ..studies.cost.points import Study

COLUMNS = (
    "line", "setting", "error", "seconds", "own_seconds", "on_front", "use", "asked_for_by", "failure",
)  # fmt: skip

#: Number of characters of a failure that are printed; the CSV file has all.
WIDTH = 120

#: The error to which the closing advice refers.
SENTENCE = 1e-3


def _source(ctx: click.Context, param: click.Parameter, value: str) -> str:
    """Return the file of a scene or robot; both may be shipped ones, given by name."""
    return (scene_file if value.endswith(".toml") else robot_file)(ctx, param, value)


def _target(ctx: click.Context, param: click.Parameter, value: float | None) -> float | None:
    """Check that a target is positive and finite."""
    if value is not None and not (math.isfinite(value) and value > 0):
        raise click.BadParameter(f"{value:g} is no error: give a number above zero, as 1e-3", ctx, param)
    return value


def _table(ctx: click.Context, param: click.Parameter, value: str | None) -> str | None:
    """Check that a file ends in .csv and can be written."""
    if value is not None and value != "-" and not value.lower().endswith(".csv"):
        raise click.BadParameter(f"'{value}' must end in .csv", ctx, param)
    return result_file(ctx, param, value)


@click.command("cost", short_help="Measure what accuracy costs in time, for your robot.")
@click.argument("source", callback=_source, metavar="ROBOT|SCENE", shell_complete=complete_robot)
@click.argument("trajectory", required=False, callback=existing_file, shell_complete=complete_data)
@click.option(
    "--target",
    type=float,
    callback=_target,
    help="Print only the fastest setting with this error, as lines for a scene; exit status 1 if none.",
)
@click.option(
    "--until", type=click.FloatRange(0, min_open=True), help="Simulate a scene to this time [s] only."
)
@click.option(
    "--limit",
    type=click.FloatRange(0, min_open=True),
    help="Stop runs of a scene that take longer [s]  [default: 10, or three times the scene's own solver]",
)
@click.option("--allow-python", is_flag=True, help="Let the scene run the Python controller that it names.")
@click.option(
    "-o",
    "--output",
    metavar="FILE",
    callback=_table,
    help="Write all measurements as CSV; '-' is standard output, the table then goes to standard error.",
)
@click.option(
    "--plot", metavar="FILE", callback=figure_file, help="Error against time as a figure: .png, .svg or .pdf."
)
def command(
    source: str,
    trajectory: str | None,
    target: float | None,
    until: float | None,
    limit: float | None,
    allow_python: bool,
    output: str | None,
    plot: str | None,
) -> int:
    """Measure what accuracy costs in time: 'cost ROBOT TRAJECTORY' or 'cost SCENE'.

    The command measures error and time of many settings. For a robot and a trajectory these are effects,
    general path or compiled C, float32 or float64, tolerance of closures, and source of rates. For a scene
    they are methods, steps, tolerances, projection, general path or compiled C, and effects. Errors are
    relative to a reference, whose own error is shown. Times are measured on this machine.
    """
    from ..description.shipped import own_trajectory

    scene = source.endswith(".toml")
    if not scene and trajectory is None:
        trajectory = own_trajectory(source)
    if scene == (trajectory is not None):
        raise click.UsageError("give a robot and a trajectory, or a scene alone (a .toml file)")
    if not scene and (until or limit or allow_python):
        raise click.UsageError("--until, --limit and --allow-python are for scenes")
    with Progress("configurations") as bar:
        done = [0]

        def progress(_: str) -> None:
            """Count one more configuration."""
            done[0] += 1
            bar.show(done[0], None)

        if scene:
            study = _scene(source, until, limit, allow_python, progress)
        else:
            study = _robot(source, str(trajectory), progress)
    if output:
        _write(study, output)
    if plot:
        from ..figures.cost import figure_of

        save(figure_of(study, os.path.basename(source)), plot)
    return _tell(study, target, to_stderr=output == "-")


def _robot(source: str, trajectory: str, progress: Callable[[str], None]) -> Study:
    """Measure a robot on a trajectory, with every effect that its files state."""
    import hybridyn

    from ..effects import choose
    from ..errors import TrajectoryError
    from ..streams.postures import Postures, all_postures
    from ..studies.cost.models import Trajectory, study_models

    robot = hybridyn.load(source)
    _, blocks = all_postures(robot, trajectory)
    motion, q, v, a = Postures.joined(blocks)
    if motion.wrenches:
        raise TrajectoryError(
            f"has wrenches ({', '.join(map(repr, motion.wrenches))}), which 'cost' does not measure: leave "
            "their columns out",
            file=trajectory,
        )
    return study_models(robot, Trajectory(q, v, a, motion.time), choose(robot, "model"), progress)


def _scene(
    source: str, until: float | None, limit: float | None, allow_python: bool, progress: Callable[[str], None]
) -> Study:
    from ..errors import TrajectoryError
    from ..scenes.stage import stage
    from ..studies.cost.runs import LIMIT, study_runs

    ready = stage(source, allow_python=allow_python)
    if ready.motion is not None:
        raise TrajectoryError(
            "the scene's motion is given: nothing is integrated. Try 'hybridyn cost ROBOT TRAJECTORY'",
            file=source,
        )
    duration = ready.source.scene.duration
    return study_runs(ready, min(duration, until or duration), progress, limit or LIMIT)


def _tell(study: Study, target: float | None, *, to_stderr: bool) -> int:
    """Print the table or, with a target, the lines for a scene; return the exit status."""
    from ..studies.cost.points import advice, cheapest

    if target is None:
        for line in _report(study):
            click.echo(line, err=to_stderr)
        return 0
    sentence, best = advice(study, target), cheapest(study, target)
    if best is None:
        click.echo(f"error: {sentence}", err=True)
        return 1
    click.echo(f"# {sentence}\n{best.fragment}", err=to_stderr)
    return 0


def _report(study: Study) -> list[str]:
    from ..studies.cost.points import advice, error_words, front

    worth = front(study.points, study.own_error)
    per_sample = study.time_unit == "per sample"
    rows = [
        ["", "choice", "setting", "error", f"time {study.time_unit}", "of it this choice"][: 5 + per_sample]
    ]
    for point in study.points:
        if point.failure:
            continue
        mark = "*" if point in worth else "-" if point.use == "comparison" else ""
        cells = [mark, point.line, point.setting, error_words(point, study), _time(point.seconds)]
        rows.append([*cells, _time(point.own)][: 5 + per_sample])
    lines = [study.question, "", *aligned_rows(rows, right=(3, 4, 5)), ""]
    lines += _failures(study)
    lines.append("* worth having: nothing else is both faster and more accurate")
    if any(point.use == "comparison" for point in study.points):
        lines.append("- for comparison only: its loops are open")
    lines.append(f"errors are against {study.reference} (its own error: {study.own_error:.0e})")
    return [*lines, advice(study, SENTENCE)]


def _failures(study: Study) -> list[str]:
    """Return lines that name settings without a result and the reason, grouped by reason."""
    found: dict[tuple[str, str], list[str]] = {}
    for p in study.points:
        if p.failure:
            why = textwrap.shorten(p.failure, WIDTH, placeholder=" ...")
            found.setdefault((p.line, why), []).append(p.setting)
    lines = [f"no result: {line}, {'; '.join(settings)}: {why}" for (line, why), settings in found.items()]
    return [*lines, ""] if lines else []


def _time(seconds: float) -> str:
    unit, factor = ("us", 1e6) if seconds < 1e-2 else ("s", 1.0)
    return f"{seconds * factor:.3g} {unit}"


def _write(study: Study, output: str) -> None:
    from ..studies.cost.points import front

    worth = front(study.points, study.own_error)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for p in study.points:
        lines = p.fragment.replace("\n", "; ")
        writer.writerow(
            [p.line, p.setting, p.error, p.seconds, p.own, int(p in worth), p.use, lines, p.failure]
        )
    if output == "-":
        click.echo(text.getvalue(), nl=False)
        return
    from ..description.writing import write_text

    write_text(output, text.getvalue())
