"""`hybridyn cost`: measure what accuracy costs in time, for one robot and its motion."""

from __future__ import annotations

import math
import os
import sys
import textwrap
import time
from collections.abc import Iterator
from dataclasses import asdict
from functools import partial
from typing import Any

import click

from ..assembly.redundancy import LEAST
from ..description.shipped import own_trajectory
from ..errors import TrajectoryError
from ..studies.cost.points import (
    ADVISED,
    OURS,
    CostPoint,
    CostStudy,
    Worth,
    advice,
    cheapest,
    error_words,
    front,
    time_words,
)
from .common.figures import save
from .common.files import write_report
from .common.options import RobotChoice, refuse
from .common.text import aligned_rows

#: Number of characters of a line of progress, and half of those of a remark.
WIDTH = 120

#: Most rows of the front that are printed.
MOST_ROWS = 12


def run(
    load: RobotChoice, trajectory: str | None, target: float | None, every: bool, output: str | None,
    plot: str | None, **given: Any,
) -> int:  # fmt: skip
    """Measure settings and effects, print them, and return the exit status."""
    scene = load.robot.endswith(".toml")
    trajectory = trajectory or (None if scene else own_trajectory(load.robot))
    _refuse_misuse(load, trajectory, **given)
    study, status = CostStudy("", "per run" if scene and not given["engines"] else "per sample"), 0
    try:
        _measure(study, load, trajectory, target or ADVISED, **given)
    except KeyboardInterrupt:
        if not study.points:
            raise
        status = 130  # as of a program that Ctrl-C ends
        study.remarks.append("stopped by Ctrl-C: what follows was not measured")
    if output:
        write_report(output, _rows(study))
    if plot:
        from ..figures.cost import chart_of_cost

        save(chart_of_cost(study, os.path.basename(load.robot)), plot)
    if target is None:
        click.echo("\n".join(_report(study, every=every)))
        return status
    best, said = cheapest(study, target), advice(study, target)
    if best is None:
        click.echo(f"error: {said[0]}", err=True)
        return 1
    click.echo("\n".join([*(f"# {line}" for line in said), best.fragment, *study.needed]))
    return status


def _refuse_misuse(
    load: RobotChoice, trajectory: str | None, *, quantity: str, until: float | None, allow_python: bool,
    redundancy: str, **_: object,
) -> None:  # fmt: skip
    """Refuse options that do not belong together, in words that say what to type."""
    source, scene = load.robot, load.robot.endswith(".toml")
    refuse(
        (
            trajectory is not None and trajectory.lower().endswith(".toml"),
            f"'{trajectory}' is a scene, which names its robot: 'hybridyn cost {trajectory}'",
        ),
        (
            scene and trajectory is not None,
            f"a scene has its own motion: 'hybridyn cost {source}', without '{trajectory}'",
        ),
        (
            not scene and trajectory is None,
            "give a robot and a trajectory, or a scene alone (a .toml file)",
        ),
        (scene and load != RobotChoice(source), "the robot's options stand in the scene: leave them out"),
        (scene and redundancy != LEAST, "--redundancy is for a trajectory: write the rule in the scene"),
        (not scene and (until or allow_python), "--until and --allow-python are for scenes"),
        (
            scene and quantity != "idm",
            "--quantity is for a robot and a trajectory; --with compares accelerations along a scene",
        ),
    )


def _show(study: CostStudy, started: float, result: CostPoint | Worth) -> None:
    """Print a result on standard error when it is measured, if a person looks; and the time left."""
    spent = time.perf_counter() - started
    words = (
        f"without {result[0]}: {result[1]:.1e}"
        if isinstance(result, tuple)
        else (
            f"{result.line}, {result.setting}: {error_words(result, study)} in {time_words(result.seconds)}"
        )
    )
    if sys.stderr.isatty():
        left = f"{spent:4.0f} s, {spent / study.done - spent:3.0f} s left  "
        click.echo(textwrap.shorten(left + words, WIDTH), err=True)


def _measure(
    study: CostStudy, load: RobotChoice, trajectory: str | None, target: float, *, quantity: str,
    engines: list[str] | None, until: float | None, seconds: float, allow_python: bool, redundancy: str,
) -> None:  # fmt: skip
    """Measure a scene, or a robot on a trajectory: every effect of its files, or those that engines have."""
    from ..effects.choice import choose, stated_names
    from ..scenes.stage import stage
    from ..streams.one_pass import read_postures
    from ..studies.cost.measured import Trajectory
    from ..studies.cost.runs import states_of, study_runs
    from ..studies.cost.variants import study_models

    show = partial(_show, study, time.perf_counter())
    if trajectory is None:
        ready = stage(load.robot, allow_python=allow_python)
        robot, duration = ready.robot, min(ready.source.scene.duration, until or math.inf)
        if ready.motion is not None:
            raise TrajectoryError(
                "the scene's motion is given: nothing is integrated. Try 'hybridyn cost ROBOT TRAJECTORY'",
                file=load.robot,
            )
        if not engines:
            study_runs(ready, duration, show, seconds, study, target)
            return
        quantity, states = "ddm", states_of(ready, duration, choose(robot, ["default"]))
    else:
        robot = load()
        layout, (motion, q, v, a) = read_postures(robot, trajectory, redundancy)
        if motion.wrenches:
            raise TrajectoryError(
                f"has wrenches ({', '.join(map(repr, motion.wrenches))}), which 'cost' does not measure: "
                "leave their columns out",
                file=trajectory,
            )
        table = None if layout.full_state or motion.time is None else motion
        states = Trajectory(q, v, a, motion.time, table, redundancy)
    study_models(
        robot, states, choose(robot, ["default", *(() if engines else stated_names(robot))]), show, study,
        quantity=quantity, engines=engines or (), target=target,
    )  # fmt: skip


def _report(study: CostStudy, *, every: bool) -> Iterator[str]:
    """Yield the advice, the settings worth having, and what effects are worth."""
    own, others = (front(study.chosen(uses), study.own_error) for uses in (OURS, ("comparison",)))
    worth = [*[*own, *others[-MOST_ROWS // 2 :]][-MOST_ROWS:], cheapest(study, ADVISED)]
    shown = [p for p in study.points if every or p in worth or p.use == "usual"]
    rows = [["", "choice", "setting", "error", f"time {study.time_unit}", ""]]
    for p in sorted(shown, key=lambda p: p.seconds):
        rows.append([
            "-" if p.use == "comparison" else "*" * (p in own),
            p.line, p.setting, error_words(p, study), time_words(p.seconds), p.how,
        ])  # fmt: skip
    yield from (*advice(study, ADVISED), "", study.question, *aligned_rows(rows, right=(3, 4)))
    if study.worth:
        yield from ("", *_effects(study))
    if study.needed:
        yield from ("", f"effects for {ADVISED:g}, in the scene:", *study.needed)
    yield from ("", f"errors are against {study.reference} (its own error: {study.own_error:.0e})")
    yield from (textwrap.shorten(remark, 2 * WIDTH, placeholder=" ...") for remark in study.remarks)
    if left := len(study.points) - len(shown):
        yield f"{left} more settings were measured: --all shows them"


def _effects(study: CostStudy) -> list[str]:
    """Return a table of what effects are worth; their times follow from the operations of the model."""
    rows = [["effect", "changes", "takes", ""]]
    for one in sorted(study.worth, key=lambda one: -one.error):
        matters = one.effect in study.kept if study.kept else one.error > ADVISED
        word = ("" if one.computed else "add it") if matters else ("leave it out" if one.computed else "")
        change = f"{one.error:.1e}" if math.isfinite(one.error) else "not known"
        rows.append([one.effect.replace("_", " "), change, f"{100 * one.share:.2g} %", word])
    return aligned_rows(rows, right=(1, 2))


def _rows(study: CostStudy) -> list[dict[str, Any]]:
    """Return the settings, and what each effect is worth, as rows of a report."""
    worth = front(study.chosen(OURS), study.own_error)
    rows = [asdict(p) | {"on_front": p in worth} for p in study.points]
    rows += [{"line": "effect", "setting": one.effect, **one._asdict()} for one in study.worth]
    return [
        {k: None if isinstance(x, float) and not math.isfinite(x) else x for k, x in row.items()}
        for row in rows
    ]
