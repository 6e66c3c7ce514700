"""Measured settings: error against time, the Pareto front, and the cheapest setting for a given error."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

#: The error that an advice is about where none is asked for.
ADVISED = 1e-3

#: Time that the runs of a scene take at most [s], but for one that is under way and for building C.
SECONDS = 30.0

#: Number of measurements of a time. The least is used, since disturbances only make a computation slower.
ROUNDS = 5

#: Times within this factor count as equal; the more accurate configuration is then chosen.
NOISE = 1.05

Use = Literal["usual", "command", "program", "comparison"]


@dataclass(frozen=True)
class Point:
    """One setting.

    Attributes:
        line: Family that it belongs to: one line of the plot.
        setting: What distinguishes it within its family, in words.
        error: Relative error (see `Study`).
        seconds: Time per sample or of the whole run [s].
        fragment: Lines to paste into a scene, or comments if no scene can request it.
        failure: Why there is no result, or "".
        use: "usual" for the default, "command" if a command offers it, "program" if only a program of your
            own can use it, "comparison" if it is for comparison only.
        what: How to obtain it, in words that continue "For 0.1 %, ...".
        own: The part of `seconds` that the setting affects [s].
        one_call: Whether it is the time of one sample at a time; else that of a batch or a run.
        elsewhere: Error on a second motion; nan if there is none.
        part: Part of the scene that was run; the time is extrapolated if it is not 1.
        how: How error or time was found if not by a complete run, in words.
    """

    line: str
    setting: str
    error: float
    seconds: float
    fragment: str
    failure: str = ""
    use: Use = "command"
    what: str = ""
    own: float = 0.0
    one_call: bool = False
    elsewhere: float = float("nan")
    part: float = 1.0
    how: str = ""


class Worth(NamedTuple):
    """What one effect is worth along a motion or in a scene.

    Attributes:
        effect: Its name.
        error: Error without it; for an effect that is not computed, the change that it causes.
        share: The part of the operations (or of the time of a run) that it takes.
        computed: Whether the motion's model or the scene computes it.
    """

    effect: str
    error: float
    share: float
    computed: bool


@dataclass(eq=False)
class Study:
    """All settings of one question, as far as they have been measured.

    Attributes:
        question: Definition of error and time, in words.
        time_unit: "per sample" or "per run".
        subject: The quantity that has the errors: "motor efforts" or "the last posture".
        usual: The usual setting, in words.
        reference: The reference of the errors, in words.
        own_error: Relative error of the reference; smaller errors of points are not known.
        second: The second motion of `Point.elsewhere`, in words.
        points: The settings.
        worth: What each effect is worth.
        remarks: Further findings, in words.
    """

    question: str
    time_unit: str
    subject: str = "motor efforts"
    usual: str = "the general path with every effect"
    reference: str = ""
    own_error: float = 0.0
    second: str = ""
    points: list[Point] = field(default_factory=list)
    worth: list[Worth] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)


def timed(function: Callable[[], Any], rounds: int = ROUNDS) -> tuple[Any, float]:
    """Return a function's result and the least of its times [s]; a call longer than 1 s is not repeated."""
    best, result = float("inf"), None
    for _ in range(rounds):
        start = clock.perf_counter()
        result = function()
        best = min(best, clock.perf_counter() - start)
        if best > 1.0:
            break
    return result, best


def front(points: Sequence[Point], own_error: float = 0.0) -> list[Point]:
    """Return the Pareto front: the points for which no other is both faster and more accurate, fastest first.

    A point that saves less than `NOISE` of a more accurate one's time is left out.

    Args:
        points: The points; comparisons and failures are ignored.
        own_error: Error of the reference; errors below it count as equal.
    """
    good = [(p.seconds, max(p.error, own_error), p) for p in points if _counts(p)]
    out: list[Point] = []
    least = float("inf")
    for _, error, point in sorted(good, key=lambda x: x[:2]):
        if error < least:
            least = error
            out.append(point)
    kept: list[Point] = []
    for point in reversed(out):
        if not kept or point.seconds * NOISE <= kept[-1].seconds:
            kept.append(point)
    return kept[::-1]


def cheapest(study: Study, target: float) -> Point | None:
    """Return the fastest point with an error of at most `target` that a command offers, or None."""
    return _cheapest(study, target, ("usual", "command"))


def advice(study: Study, target: float) -> str:
    """Recommend a configuration for an error of at most `target`, in one sentence."""
    portion = f"{100 * target:.4g} %" if 1e-5 <= target < 10 else f"{target:.2g}"
    wanted = f"For {portion} on {study.subject}"
    best = cheapest(study, target)
    if best is None:
        reached = min((p.error for p in study.points if _counts(p)), default=float("inf"))
        best_known = max(reached, study.own_error)
        return f"{wanted} no configuration that was tried suffices: the least error is {best_known:.1e}."
    usual = next((p for p in study.points if p.use == "usual" and not p.failure), None)
    own = _cheapest(study, target, ("usual", "command", "program"))
    more = ""
    if own is not None and own.use == "program" and best.seconds > NOISE * own.seconds:
        ratio = _speed(own, usual or best)
        more = (
            f"; in a program of your own, {own.what}: {_times(ratio)} times (error {error_words(own, study)})"
        )
    if best.elsewhere > target:
        more += f"; it does not carry over to {study.second}, where its error is {best.elsewhere:.1e}"
    if usual is None or best is usual:
        kept = "" if usual is None else ": nothing cheaper suffices"
        return f"{wanted}, {best.what} (error {error_words(best, study)}){kept}{more}."
    return f"{wanted}, {best.what}: {_against(best, usual, study)} (error {error_words(best, study)}){more}."


def _counts(point: Point) -> bool:
    return not point.failure and point.use != "comparison" and point.part == 1.0


def _cheapest(study: Study, target: float, uses: Sequence[Use]) -> Point | None:
    """Return the fastest point within the target; among equal times the most accurate."""
    if target < study.own_error:
        return None
    good = [p for p in study.points if _counts(p) and p.use in uses and p.error <= target]
    if not good:
        return None
    least = min(p.seconds for p in good)
    return min((p for p in good if p.seconds <= NOISE * least), key=lambda p: (p.error, p.seconds))


def _against(point: Point, usual: Point, study: Study) -> str:
    """Compare a point's time with the usual one's, in words."""
    ratio = _speed(point, usual)
    faster = f"{_times(ratio)} times as fast as" if ratio >= NOISE else "no faster than"
    return f"{faster} {study.usual}"


def _times(ratio: float) -> str:
    """Write a ratio of times with two digits."""
    return f"{ratio:.0f}" if ratio >= 10 else f"{ratio:.2g}"


def _speed(point: Point, usual: Point) -> float:
    """Return how many times as fast as another a point is; 1 where the clock was too coarse for it."""
    return usual.seconds / point.seconds if point.seconds > 0 else 1.0


def error_words(point: Point, study: Study) -> str:
    """Format a point's error; an error below that of the reference is shown as "< ..."."""
    least = study.own_error
    return f"< {least:.0e}" if point.error < least else f"{point.error:.1e}"
