"""Measured configurations: error against time, the front of those worth having, the cheapest that will do."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

ROUNDS = 5
"""Measurements of a time; the least counts, since nothing makes a computation faster than it is."""


@dataclass(frozen=True)
class Point:
    """One configuration.

    Attributes:
        line: Family that it belongs to: one line of the plot.
        setting: What distinguishes it in its family, in words.
        error: Its error, relative (see `Study`).
        seconds: Its time: per sample, or for the whole run [s].
        fragment: Lines that ask for it: a command's options, or lines of a scene.
        failure: Why there is no result, or "".
    """

    line: str
    setting: str
    error: float
    seconds: float
    fragment: str
    failure: str = ""


class Study(NamedTuple):
    """All configurations of one question.

    Attributes:
        question: What error and time mean, in words.
        points: The configurations.
        reference: What the errors are against, in words.
        own_error: Error of the reference itself, relative.
        time_unit: "per sample" or "per run".
    """

    question: str
    points: list[Point]
    reference: str
    own_error: float
    time_unit: str


def timed(function: Callable[[], Any], rounds: int = ROUNDS) -> tuple[Any, float]:
    """Give a function's result and the least of its times [s]; long calls are measured less often."""
    best, result = float("inf"), None
    for _ in range(rounds):
        start = clock.perf_counter()
        result = function()
        best = min(best, clock.perf_counter() - start)
        if best > 1.0:
            break
    return result, best


def front(points: Sequence[Point]) -> list[Point]:
    """Give the points that no other one beats in both error and time, cheapest first."""
    out: list[Point] = []
    for point in sorted((p for p in points if not p.failure), key=lambda p: (p.seconds, p.error)):
        if not out or point.error < out[-1].error:
            out.append(point)
    return out


def cheapest(points: Sequence[Point], target: float) -> Point | None:
    """Give the cheapest point whose error is at most `target`, or None."""
    good = [point for point in front(points) if point.error <= target]
    return good[0] if good else None


def advice(study: Study, target: float) -> str:
    """Give one sentence that a person can act on."""
    best = cheapest(study.points, target)
    if best is None:
        reached = min((p.error for p in study.points if not p.failure), default=float("nan"))
        return f"Nothing that was tried comes within {target:.2g}; the best error is {reached:.2g}."
    usual = [p for p in study.points if not p.failure and p.setting.endswith("(usual)")]
    faster = f": {usual[0].seconds / best.seconds:.2g} times as fast as the usual way" if usual else ""
    if usual and best is usual[0]:
        return f"For {target:.2g} keep the usual way ({best.line}, {best.setting}): nothing cheaper will do."
    return f"For {target:.2g} take {best.line}, {best.setting}{faster} (its error is {best.error:.1e})."
