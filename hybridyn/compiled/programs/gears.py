"""Losses of gears in programs: efforts of motors from those of joints, and the reverse."""

from __future__ import annotations

import casadi as ca
import numpy as np

from ...effects.gears import OnGears, needed, passed_on, slopes
from ...spatial import Index, numpy_on_symbols
from ..equations.coefficients import gear_slots, width_slot
from ..equations.request import Request
from ..program import Constants, Each, GivenPlace, ResultPlace, Shared, Source, Worst
from .writer import Writer


def lossy(gears: OnGears | None, motors: Index) -> bool:
    """Return whether a gear of some motors, by their numbers in the robot, is among those that lose."""
    return gears is not None and bool(np.isin(motors, gears.motors).any())


def write_needed(
    request: Request, w: Writer, gears: OnGears, motors: Index, joint_side: Shared, result: ResultPlace
) -> None:
    """Add the efforts of motors.

    Args:
        w: The program under construction.
        gears: The law.
        motors: Numbers of the motors in the robot.
        joint_side: Efforts behind the gears.
        result: Where those before the gears go.
    """
    tau, mean, half, v, width = (ca.SX.sym(name) for name in ("tau", "mean", "half", "v", "width"))
    with numpy_on_symbols():
        effort = needed(mean, slopes(half, v, width), tau)
    function = ca.Function("gear", [tau, mean, half, v, width], [effort])
    target = ResultPlace(result.index.reshape(-1, 1))
    sources = [Each(joint_side.start, 1), *_numbers(request, w, gears, motors)]
    w.call(w.kernel("gears, inverse", function, "effects"), len(motors), sources, [target])


def write_passed_on(
    request: Request, w: Writer, gears: OnGears, motors: Index, given: GivenPlace | ResultPlace
) -> Each:
    """Add the efforts of joints, and a guard that is infinite where a gear locks itself; return their place.

    Args:
        w: The program under construction.
        gears: The law.
        motors: Numbers of the motors in the robot, shape (copies, entries).
        given: Efforts of the motors.
    """
    tau, mean, half, v, width = (ca.SX.sym(name) for name in ("tau", "mean", "half", "v", "width"))
    with numpy_on_symbols():
        slope = slopes(half, v, width)
        effort, least = passed_on(mean, slope, tau), mean - np.abs(slope)
    guard = ca.if_else(least > 0, 0.0, np.inf)
    function = ca.Function("gear", [tau, mean, half, v, width], [effort, guard])
    place = w.each(*motors.shape)
    single = type(given)(given.index.reshape(-1, 1))
    sources: list[Source] = [single, *_numbers(request, w, gears, motors.ravel())]
    kernel = w.kernel("gears, direct", function, "effects")
    w.call(kernel, motors.size, sources, [Each(place.start, 1), Worst()])
    return place


def _numbers(request: Request, w: Writer, gears: OnGears, motors: Index) -> list[Source]:
    """Return the sources of mean, half, rate and width of motors.

    A gear without loss has 1, 0, and any rate.
    """
    at = {int(motor): n for n, motor in enumerate(gears.motors)}
    own = [at.get(int(motor)) for motor in motors]
    mean = np.array([[1.0 if n is None else gears.mean[n]] for n in own])
    half = np.array([[0.0 if n is None else gears.half[n]] for n in own])
    rates = np.array([[gears.columns[n or 0]] for n in own])
    names = [request.robot.motors[int(motor)] for motor in motors]
    width, slots = width_slot(gears.effect), request.slots
    last: list[Source] = [w.from_given("v", rates), Constants(np.full(rates.shape, gears.effect.width))]
    if width in slots:
        last[1] = w.from_given("parameters", np.full(rates.shape, slots.index(width)))
    if set(slots).isdisjoint(slot for name in names for slot in gear_slots(gears, name)):
        return [Constants(mean), Constants(half), *last]
    places = w.each(len(motors), 1), w.each(len(motors), 1)
    for i, name in enumerate(names):
        values = [Constants(np.array([[x]])) for x in (mean[i, 0] + half[i, 0], mean[i, 0] - half[i, 0])]
        _write_numbers(request, w, gears, name, values, [Shared(place.start + i, 1) for place in places])
    return [*places, *last]


def _write_numbers(
    request: Request, w: Writer, gears: OnGears, motor: str, values: list[Constants], to: list[Shared]
) -> None:
    """Add the call that computes mean and half of one gear, from arguments where it has some.

    Args:
        motor: The motor.
        values: What it needs per effort, driving and driven.
        to: Places of mean and half.
    """
    own, slots = gear_slots(gears, motor), request.slots
    drive, driven = ca.SX.sym("drive"), ca.SX.sym("driven")
    sources: list[Source] = [*values]
    for i, slot in enumerate(own):
        if slot in slots:
            sources[i] = w.from_given("parameters", np.array([slots.index(slot)]))
    given = [isinstance(source, Constants) for source in sources]
    needs = drive if given[0] else 1 / drive
    back = 2 - needs if own and len(own) == 1 else driven
    function = ca.Function("gear", [drive, driven], [(needs + back) / 2, (needs - back) / 2])
    key = ("gears, numbers", given[0], len(own))
    w.call(w.kernel(key, function, "effects"), 1, sources, [*to])
