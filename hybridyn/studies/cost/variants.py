"""Measure error and time of a quantity along a trajectory: effects, arithmetic, calls, rates, engines.

The time of a sample is the sum of its stages: closing its loops from the sample before, and the model; a
setting replaces one of them. Compiled ways come early, since they are the ones to take.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np

from ...compiled import compile
from ...effects.choice import Effects
from ...errors import HybridynError
from ...spatial import Array
from ...structure.robot import HybridRobot
from ...tables.rates import derivatives
from ..compare.methods import Method, methods_of
from .measured import Measured, Trajectory
from .points import ADVISED, QUANTITIES, CostPoint, CostStudy, Progress, Step, fill, timed
from .reference import blocks, off
from .spared import by_effects
from .ways import IN_C, Way, solver, ways

#: Number of rows at either end that are ignored, since the rates of a spline are inaccurate there.
EDGE = 40


def study_models(
    robot: HybridRobot, trajectory: Trajectory, effects: Effects,
    progress: Progress = lambda result: None, study: CostStudy | None = None, *,
    quantity: str = "idm", engines: Sequence[str] = (), target: float = ADVISED,
) -> CostStudy:  # fmt: skip
    """Measure the settings of a model along a trajectory.

    The error of a setting is the largest difference from the reference: of an effort, relative to the motor's
    largest effort; of another quantity, relative to its largest number. The reference is the model with all
    of `effects` in 113-bit arithmetic.

    Args:
        progress: Called with each setting and each effect when it is measured.
        study: Filled as points are measured; a new one by default.
        quantity: One of `QUANTITIES`.
        engines: Names of `ENGINES` or of packages, whose settings are swept, too; they compute rigid bodies
            alone.
        target: Error for which a set of effects is built and run.

    Raises:
        ModelError: An engine is unknown.
        HybridynError: The model cannot follow the trajectory.
    """
    methods = {name: methods_of(name, quantity) for name in engines}
    study = CostStudy("", "per sample") if study is None else study
    study.subject = QUANTITIES[quantity]
    study.question = f"error of {study.subject} against time per sample, {len(trajectory.q):,} rows"
    if not robot.motors:
        raise HybridynError(
            f"robot '{robot.name}' has no motors, and so no {study.subject}: name some (--motors)"
        )
    run = Measured(study, robot, trajectory, effects, quantity)
    fill(study, _steps(run, [method for known in methods.values() for method in known], target), progress)
    study.remarks += [
        f"{name}: has none of {study.subject} of robots with loops"
        for name, known in methods.items()
        if not known
    ]
    return study


def _steps(run: Measured, others: Sequence[Method], target: float) -> list[Step]:
    """Return the measurements of our own ways, of effects, of the source of rates, and of other engines."""
    quantity, robot, motion = run.quantity, run.robot, run.trajectory.motion
    steps: list[Step] = [(way.method.name, run.by_way(way)) for way in ways(quantity, run.effects)]
    if quantity == "close" or (run.stages and motion and {*motion.joints} == {*robot.motors}):
        steps.append(("from the motors", run.by_ticks()))
    if quantity in ("idm", "ddm"):
        steps.append(("effects", by_effects(run, target)))
    if quantity == "idm":
        steps.append(("rates", by_rates(run)))
    steps += [(method.name, run.by_way(Way(method, "comparison", setting=""))) for method in others]
    return steps


def by_rates(run: Measured) -> Iterator[CostPoint]:
    """Compare rates from a spline and from differences of the motors' positions with those of the table.

    Raises:
        HybridynError: There is nothing to compare.
    """
    robot, time, (q, v, a) = run.robot, run.trajectory.time, run.trajectory[:3]
    odd = not all(robot.kinds[robot.joint_index[motor]].additive for motor in robot.motors)
    if time is None or len(time) < 3 * EDGE or robot.base != "fixed" or odd:
        raise HybridynError(
            f"not measured: needs times, {3 * EDGE} rows or more, a fixed base, and motors on revolute and "
            "prismatic joints"
        )
    x, inner = q[:, robot.motor_q], slice(EDGE, len(time) - EDGE)
    efforts, model = solver("idm", robot, run.effects), compile(robot, run.effects, wait=True)
    (wanted,) = blocks(efforts(q[inner], v[inner], a[inner]))
    after = next(point.seconds for point in run.study.points if point.line == IN_C)
    rules = {
        "quintic spline": partial(derivatives, time, x, slice(0, len(time))),
        "central differences": partial(_differences, time, x),
    }
    for words, rule in rules.items():
        moved = model.assemble(motors=(x, *rule()), guess=q[0])
        yield CostPoint(
            "rates of the trajectory", words,
            off(efforts(*(one[inner] for one in moved)), wanted, efforts=True),
            timed(rule)[0] / len(time) + after, f"# rates by {words} of the motors' positions",
            use="program", what=f"take rates by {words}",
        )  # fmt: skip


def _differences(time: Array, x: Array) -> tuple[Array, Array]:
    """Fit rates by central differences."""
    rate = np.gradient(x, time, axis=0)
    return rate, np.gradient(rate, time, axis=0)
