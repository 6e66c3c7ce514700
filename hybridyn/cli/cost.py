"""`hybridyn cost`: what accuracy costs in time, for one robot and its motion."""

from __future__ import annotations

import csv
import os
from collections.abc import Callable
from typing import TYPE_CHECKING

import click

from hybridyn.cli.figures import figure_file
from hybridyn.cli.progress import Progress
from hybridyn.cli.robot_options import (
    complete_data,
    complete_robot,
    existing_file,
    result_file,
    robot_file,
    scene_file,
)
from hybridyn.cli.summary import aligned_rows

if TYPE_CHECKING:
    from hybridyn.cost.points import Point, Study

COLUMNS = ("line", "setting", "error", "seconds", "on_front", "asked_for_by", "failure")


def _source(ctx: click.Context, param: click.Parameter, value: str) -> str:
    """Give the file of a scene, or of a robot, which may be named."""
    return (scene_file if value.endswith(".toml") else robot_file)(ctx, param, value)


@click.command("cost", short_help="What accuracy costs in time, for your robot and motion.")
@click.argument("source", callback=_source, metavar="ROBOT|SCENE", shell_complete=complete_robot)
@click.argument(
    "trajectory",
    required=False,
    callback=lambda c, p, v: v and existing_file(c, p, v),
    shell_complete=complete_data,
)
@click.option(
    "--target", type=click.FloatRange(0, min_open=True), help="Print only the cheapest way to this error."
)
@click.option(
    "--until", type=click.FloatRange(0, min_open=True), help="Simulate a scene to this time [s] only."
)
@click.option("-o", "--output", metavar="FILE", callback=result_file, help="All that was measured, as CSV.")
@click.option(
    "--plot", metavar="FILE", callback=figure_file, help="Error against time as a figure: .png, .svg or .pdf."
)
def command(
    source: str,
    trajectory: str | None,
    target: float | None,
    until: float | None,
    output: str | None,
    plot: str | None,
) -> None:
    """Measure what accuracy costs in time: 'cost ROBOT TRAJECTORY' or 'cost SCENE'.

    For a robot and a trajectory: which effects are on, general path or written-out C, float32 or float64, how
    far loops are closed, where rates come from. For a scene: methods, steps, tolerances, projection. Errors
    are against a reference whose own error is shown; times are measured here and now.
    """
    scene = source.endswith(".toml")
    if scene == (trajectory is not None):
        raise click.UsageError("give a robot and a trajectory, or a scene alone (a .toml file)")
    with Progress("configurations") as bar:
        done = [0]

        def progress(what: str) -> None:
            done[0] += 1
            bar.show(done[0], None)
            del what

        study = _scene(source, until, progress) if scene else _robot(source, str(trajectory), progress)
    if output:
        _write(study, output)
    if plot:
        from hybridyn.cost.drawing import figure_of

        figure_of(study, f"{os.path.basename(source)}: {study.question}").savefig(plot, dpi=120)
    for line in _report(study, target):
        click.echo(line)


def _robot(source: str, trajectory: str, progress: Callable[[str], None]) -> Study:
    """Measure a robot on a trajectory, with every effect that its files state."""
    import numpy as np

    import hybridyn
    from hybridyn.cli.postures import all_postures
    from hybridyn.cost.models import Trajectory, study_models
    from hybridyn.effects import choose

    robot = hybridyn.load(source)
    _, blocks = all_postures(robot, trajectory)
    q, v, a = (np.concatenate([getattr(block, x) for block in blocks]) for x in ("q", "v", "a"))
    times = None if blocks[0].motion.time is None else np.concatenate([block.motion.time for block in blocks])
    return study_models(robot, Trajectory(q, v, a, times), choose(robot, "model"), progress)


def _scene(source: str, until: float | None, progress: Callable[[str], None]) -> Study:
    """Measure a scene."""
    from hybridyn.cost.runs import study_runs
    from hybridyn.errors import TrajectoryError
    from hybridyn.scene import stage

    ready = stage(source)
    if ready.motion is not None:
        raise TrajectoryError("the scene's motion is given: nothing is integrated", file=source)
    duration = ready.source.scene.duration
    return study_runs(ready, min(duration, until or duration), progress)


def _report(study: Study, target: float | None) -> list[str]:
    """Give the lines to print."""
    from hybridyn.cost.points import advice, cheapest, front

    if target is not None:
        best = cheapest(study.points, target)
        return [advice(study, target)] if best is None else [f"# {advice(study, target)}", best.fragment]
    worth = front(study.points)
    rows = [["", "knob", "setting", "error", f"time {study.time_unit}"]]
    for point in study.points:
        mark = "*" if point in worth else ""
        rows.append([mark, point.line, point.setting, *_numbers(point)])
    lines = [study.question, "", *aligned_rows(rows, right=(3, 4)), ""]
    lines.append("* worth having: nothing else is both faster and more accurate")
    lines.append(f"errors are against {study.reference} (its own error: {study.own_error:.0e})")
    return [*lines, advice(study, 1e-3)]


def _numbers(point: Point) -> list[str]:
    """Give error and time as words."""
    if point.failure:
        return ["-", point.failure[:60]]
    unit, factor = ("us", 1e6) if point.seconds < 1e-2 else ("s", 1.0)
    return [f"{point.error:.1e}", f"{point.seconds * factor:.3g} {unit}"]


def _write(study: Study, output: str) -> None:
    """Write everything as CSV."""
    from hybridyn.cost.points import front

    worth = front(study.points)
    with open(output, "w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        for p in study.points:
            row = [
                p.line,
                p.setting,
                p.error,
                p.seconds,
                int(p in worth),
                p.fragment.replace("\n", "; "),
                p.failure,
            ]
            writer.writerow(row)
