"""Measured configurations: error against time, the front of those worth having, the cheapest that will do."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

#: Measurements of a time; the least counts, since nothing makes a computation faster than it is.
ROUNDS = 5

#: Times within this factor are the same time: the more accurate way is taken.
NOISE = 1.05

Use = Literal["usual", "command", "program", "comparison"]


@dataclass(frozen=True)
class Point:
    """One configuration.

    Attributes:
        line: Family that it belongs to: one line of the plot.
        setting: What distinguishes it in its family, in words.
        error: Its error, relative (see `Study`).
        seconds: Its time: per sample, or for the whole run [s].
        fragment: Lines to paste into a scene, or comments where no scene can ask for it.
        failure: Why there is no result, or "".
        use: The "usual" way; what a "command" does; what takes a "program" of one's own; or what is there for
            "comparison" only.
        what: What to do to have it, in words, as in "For 0.1 %, ...".
        own: The part of `seconds` that the knob changes [s].
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
        question: What error and time mean, in words.
        points: The configurations.
        reference: What the errors are against, in words.
        own_error: Error of the reference itself, relative; no point is known better than that.
        time_unit: "per sample" or "per run".
        subject: What the errors are of: "motor efforts", "the last posture".
        usual: What the usual way is called.
    """

    question: str
    points: list[Point]
    reference: str
    own_error: float
    time_unit: str
    subject: str = "motor efforts"
    usual: str = "the general path with every effect"


def timed(function: Callable[[], Any], rounds: int = ROUNDS) -> tuple[Any, float]:
    """Return a function's result and the least of its times [s]; long calls are measured less often."""
    best, result = float("inf"), None
    for _ in range(rounds):
        start = clock.perf_counter()
        result = function()
        best = min(best, clock.perf_counter() - start)
        if best > 1.0:
            break
    return result, best


def front(points: Sequence[Point], own_error: float = 0.0) -> list[Point]:
    """Return the points that no other one beats in both error and time, cheapest first.

    Args:
        points: Those to choose from; comparisons and failures are not chosen.
        own_error: Error of the reference: errors below it are the same error.
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
    """Return the cheapest way to an error of at most `target` that commands can take, or None."""
    return _cheapest(study, target, ("usual", "command"))


def advice(study: Study, target: float) -> str:
    """Return one sentence that a person can act on."""
    wanted = f"For {portion(target)} on {study.subject}"
    best = cheapest(study, target)
    if best is None:
        reached = min((p.error for p in study.points if _counts(p)), default=float("inf"))
        best_known = max(reached, study.own_error)
        return f"{wanted} nothing that was tried will do: the least error is {best_known:.1e}."
    usual = next((p for p in study.points if p.use == "usual" and not p.failure), None)
    own = _cheapest(study, target, ("usual", "command", "program"))
    more = ""
    if own is not None and own.use == "program" and best.seconds > NOISE * own.seconds:
        ratio = (usual or best).seconds / own.seconds
        more = f"; in a program of your own, {own.what}: {ratio:.2g} times (error {error_words(own, study)})"
    if usual is None or best is usual:
        kept = "" if usual is None else ": nothing cheaper will do"
        return f"{wanted}, {best.what} (error {error_words(best, study)}){kept}{more}."
    return f"{wanted}, {best.what}: {_against(best, usual, study)} (error {error_words(best, study)}){more}."


def portion(number: float) -> str:
    """Write a relative error as a person says it."""
    return f"{100 * number:.4g} %" if 1e-5 <= number < 10 else f"{number:.2g}"


def _counts(point: Point) -> bool:
    """Say whether a point can be chosen."""
    return not point.failure and point.use != "comparison"


def _cheapest(study: Study, target: float, uses: Sequence[Use]) -> Point | None:
    """Return the most accurate of the points that reach the target in the least time, up to noise."""
    if target < study.own_error:
        return None
    good = [p for p in study.points if _counts(p) and p.use in uses and p.error <= target]
    if not good:
        return None
    least = min(p.seconds for p in good)
    return min((p for p in good if p.seconds <= NOISE * least), key=lambda p: (p.error, p.seconds))


def _against(point: Point, usual: Point, study: Study) -> str:
    """Say how a point's time compares to the usual one's."""
    ratio = usual.seconds / point.seconds
    faster = f"{ratio:.2g} times as fast as" if ratio >= NOISE else "no faster than"
    return f"{faster} {study.usual}"


def error_words(point: Point, study: Study) -> str:
    """Write a point's error; none is known better than the reference is."""
    least = study.own_error
    return f"< {least:.0e}" if point.error < least else f"{point.error:.1e}"
