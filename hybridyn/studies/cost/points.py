"""Measured configurations: error against time, the Pareto front, and the cheapest one for a given error."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

#: Number of measurements of a time. The least is used, since disturbances only make a computation slower.
ROUNDS = 5

#: Times within this factor count as equal; the more accurate configuration is then chosen.
NOISE = 1.05

Use = Literal["usual", "command", "program", "comparison"]


@dataclass(frozen=True)
class Point:
    """One configuration.

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


class Study(NamedTuple):
    """All configurations of one question.

    Attributes:
        question: Definition of error and time, in words.
        points: The configurations.
        reference: The reference of the errors, in words.
        own_error: Relative error of the reference; smaller errors of points are not known.
        time_unit: "per sample" or "per run".
        subject: The quantity that has the errors: "motor efforts" or "the last posture".
        usual: The usual configuration, in words.
    """

    question: str
    points: list[Point]
    reference: str
    own_error: float
    time_unit: str
    subject: str = "motor efforts"
    usual: str = "the general path with every effect"


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
    return out


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
        more = f"; in a program of your own, {own.what}: {ratio:.2g} times (error {error_words(own, study)})"
    if usual is None or best is usual:
        kept = "" if usual is None else ": nothing cheaper suffices"
        return f"{wanted}, {best.what} (error {error_words(best, study)}){kept}{more}."
    return f"{wanted}, {best.what}: {_against(best, usual, study)} (error {error_words(best, study)}){more}."


def _counts(point: Point) -> bool:
    return not point.failure and point.use != "comparison"


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
    faster = f"{ratio:.2g} times as fast as" if ratio >= NOISE else "no faster than"
    return f"{faster} {study.usual}"


def _speed(point: Point, usual: Point) -> float:
    """Return how many times as fast as another a point is; 1 where the clock was too coarse for it."""
    return usual.seconds / point.seconds if point.seconds > 0 else 1.0


def error_words(point: Point, study: Study) -> str:
    """Format a point's error; an error below that of the reference is shown as "< ..."."""
    least = study.own_error
    return f"< {least:.0e}" if point.error < least else f"{point.error:.1e}"
