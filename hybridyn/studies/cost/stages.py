"""Replace a stage: the model by one without some effects, the rates of the table by those of positions."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ...description.names import listed
from ...effects.choice import Effects
from ...errors import HybridynError
from ...spatial import Array
from ...tables.rates import derivatives
from ..compare.methods import Method
from .points import Point, Worth, timed
from .quantities import IN_C, Way, blocks, in_c, off, operations, solver
from .settings import model_fragment

if TYPE_CHECKING:
    from .models import Measured

#: Effects that are never omitted: those of platforms and serial links.
KEPT = ("gravity", "inertia")

#: Number of rows at either end that are ignored, since the rates of a spline are inaccurate there.
EDGE = 40

#: If efforts differ by less than this (relative), the table had no rates: its rates are those of the spline.
SAME_RULE = 1e-12


def optional(effects: Effects) -> list[str]:
    """Return the names of the effects that may be left out."""
    return [name for name in effects.names if name not in KEPT]


def without(effects: Effects, gone: Sequence[str]) -> Effects:
    """Return effects without some of them."""
    return effects.only([name for name in effects.names if name not in gone])


def spared(worth: Sequence[Worth], target: float, error: Callable[[list[str]], float]) -> list[str]:
    """Return the effects that an error allows to leave out, the least important first.

    Args:
        error: Gives the error without some effects together.
    """
    gone: list[str] = []
    for one in sorted((one for one in worth if one.computed), key=lambda one: one.error):
        if one.error > target or error([*gone, one.effect]) > target:
            break
        gone.append(one.effect)
    return gone


def by_effects(run: Measured, target: float) -> Iterator[Worth | Point]:
    """Measure what each effect is worth; then build and run the set that suffices for an error.

    Errors without an effect are those of the general path; its time follows from the operations of the
    compiled model.
    """
    quantity, robot, on = run.quantity, run.robot, run.effects
    every, worth = operations(robot, on, quantity), list[Worth]()

    def error(gone: Sequence[str]) -> float:
        """Return the error without some effects, infinite for a motion without mass."""
        try:
            return run.errors(solver(quantity, robot, without(on, gone)))[0]
        except HybridynError:
            return float("inf")

    for name in optional(on):
        share = 1.0 - operations(robot, without(on, [name]), quantity) / every
        worth.append(Worth(name, error([name]), share, computed=True))
        yield worth[-1]
    if gone := spared(worth, target, error):
        left = without(on, gone)
        method = Method(IN_C, quantity, partial(in_c, run.models, quantity, left, "float64"), batches=True)
        names = listed([name.replace("_", " ") for name in gone])
        what, lines = f"drop {names} and compute in C", model_fragment(left.names, "compiled", quantity)
        yield from run.by_way(Way(method, "command", what, lines, f"without {names}"))


def by_rates(run: Measured) -> Iterator[Point]:
    """Compare rates from a spline and from differences of the motors' positions with those of the table.

    Raises:
        HybridynError: There is nothing to compare.
    """
    robot, time, (q, v, a) = run.robot, run.trajectory.time, run.trajectory[:3]
    kinds = {robot.kinds[robot.joint_index[motor]] for motor in robot.motors}
    if time is None or len(time) < 3 * EDGE:
        raise HybridynError(f"not measured: needs times and {3 * EDGE} rows or more")
    if robot.base != "fixed" or kinds - {"revolute", "prismatic"}:
        raise HybridynError("not measured: needs a fixed base and motors on revolute and prismatic joints")
    x, inner = q[:, robot.motor_q], slice(EDGE, len(time) - EDGE)
    efforts, model = solver("idm", robot, run.effects), run.models.compiled(run.effects)
    (wanted,) = blocks(efforts(q[inner], v[inner], a[inner]))
    after = next(point.seconds for point in run.study.points if point.line == IN_C)
    rules = {
        "quintic spline": partial(derivatives, time, x, slice(0, len(time))),
        "central differences": partial(_differences, time, x),
    }
    for words, rule in rules.items():
        moved = model.assemble(motors=(x, *rule()), guess=q[0])
        error = off(efforts(*(one[inner] for one in moved)), wanted)
        if error < SAME_RULE:
            raise HybridynError("not measured: the table states none, so there is nothing to compare with")
        own = timed(rule)[0] / len(time)
        yield Point(
            "rates of the trajectory", words, error, own + after,
            f"# rates by {words} of the motors' positions", use="program", what=f"take rates by {words}",
            own=own,
        )  # fmt: skip


def _differences(time: Array, x: Array) -> tuple[Array, Array]:
    """Fit rates by central differences."""
    rate = np.gradient(x, time, axis=0)
    return rate, np.gradient(rate, time, axis=0)
