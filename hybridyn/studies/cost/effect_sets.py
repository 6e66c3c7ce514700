"""Measure sets of effects along a trajectory: what each is worth, and the set that pays for an error."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ...description.names import listed
from ...errors import HybridynError
from .fragments import model_fragment
from .points import NOISE, Point, Study, Worth, cheapest, timed
from .quantities import IN_C, general, operations

if TYPE_CHECKING:
    from .models import Measured

#: Effects that are never omitted: those of platforms and serial links.
KEPT = ("gravity", "inertia")


def by_effects(study: Study, run: Measured, target: float) -> Iterator[Point]:
    """Measure sets of effects: without each, then without the least important ones together.

    Errors are those of the general path; times follow from the operations of the compiled model, until the
    set that is worth advising is built and run.
    """
    robot, effects = run.robot, run.effects
    optional = [name for name in effects.names if name not in KEPT]
    every = operations(robot, effects, run.quantity)

    def measured(out: Sequence[str]) -> Point:
        """Measure the model without some effects."""
        names = tuple(name for name in effects.names if name not in out)
        on = effects.only(names)
        words = "without " + listed([name.replace("_", " ") for name in out])
        part = operations(robot, on, run.quantity) / every
        own = run.whole * (part if np.isfinite(part) else 1.0)
        error, elsewhere = run.task.errors(general(run.quantity, robot, on))
        return Point(
            IN_C, words, error, run.closing[IN_C] + own, model_fragment(names, "compiled", run.quantity),
            what=words.replace("without", "drop", 1) + " and compute in C", own=own, elsewhere=elsewhere,
            how="time by operations",
        )  # fmt: skip

    alone: dict[str, Point] = {}
    for name in optional:
        try:
            alone[name] = measured([name])
        except HybridynError as error:  # a massless motion, without the inertia of a leg
            study.remarks.append(f"without {name}: {error}")
    for name, point in alone.items():
        share = 1.0 - point.own / run.whole
        study.worth.append(Worth(name, point.error, share, computed=True))
        yield point
    optional = [*alone]
    order = sorted(optional, key=lambda name: alone[name].error)
    sets = {point.setting: [name] for name, point in alone.items()}
    for count in range(2, len(order) + 1):
        try:
            point = measured(order[:count])
        except HybridynError:
            break
        sets[point.setting] = order[:count]
        yield point
    yield from _built(study, run, sets, target)


def _built(study: Study, run: Measured, sets: dict[str, list[str]], target: float) -> Iterator[Point]:
    """Build and run the fastest set of effects that is exact enough, if it is faster than every effect."""
    known, best = cheapest(study, target), None
    for point in study.points:
        if point.setting in sets and point.error <= target and (not best or point.seconds < best.seconds):
            best = point
    if best is None or known is None or best.seconds * NOISE > known.seconds:
        return
    on = run.effects.only([name for name in run.effects.names if name not in sets[best.setting]])
    solve = getattr(run.models.compiled(on), run.quantity)
    error, elsewhere = run.task.errors(solve)
    own = timed(partial(solve, *run.task.motions[0]), 3)[1] / len(run.task.motions[0][0])
    study.points.remove(best)
    yield replace(best, error=error, elsewhere=elsewhere, own=own, seconds=run.closing[IN_C] + own, how="")
