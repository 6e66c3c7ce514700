"""Measured settings: error against time, the Pareto front, and the cheapest setting for a given error."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple, TypeVar

from ...errors import HybridynError

#: The error that an advice is about where none is asked for.
ADVISED = 1e-3

#: Time that the runs of a scene take at most [s], but for one that is under way and for building C.
SECONDS = 30.0

#: Number of measurements of a time. The least is used, since disturbances only make a computation slower.
ROUNDS = 5

#: Times within this factor count as equal; the more accurate configuration is then chosen.
NOISE = 1.05

Use = Literal["usual", "command", "program", "comparison"]
#: Uses of our own settings.
OURS: tuple[Use, ...] = ("usual", "command", "program")

Item = TypeVar("Item")


@dataclass(frozen=True)
class Point:
    """One setting.

    Attributes:
        line: Family that it belongs to: one line of the plot.
        setting: What distinguishes it within its family, in words.
        error: Relative error (see `Study`).
        seconds: Time per sample or of the whole run [s].
        fragment: Lines to paste into a scene, or comments if no scene can request it.
        use: "usual" for the default, "command" if a command offers it, "program" if only a program of your
            own can use it, "comparison" if it is for comparison only.
        what: How to obtain it, in words that continue "For 0.1 %, ...".
        own: The part of `seconds` that the setting affects [s].
        one_call: Whether it is the time of one sample at a time; else that of a batch or a run.
        elsewhere: Error on a second motion; nan if there is none.
        path: Of a run, the largest error of any of its outputs; nan if there is none, as below.
        energy: Its largest error of the energy, relative to the largest kinetic energy.
        closure: Its largest closure residual, relative to the module's length.
        how: How error or time was found if not by a complete run, in words.
    """

    line: str
    setting: str
    error: float
    seconds: float
    fragment: str
    use: Use = "command"
    what: str = ""
    own: float = 0.0
    one_call: bool = False
    elsewhere: float = float("nan")
    path: float = float("nan")
    energy: float = float("nan")
    closure: float = float("nan")
    how: str = ""


class Worth(NamedTuple):
    """What one effect is worth along a motion or in a scene.

    Attributes:
        effect: Its name.
        error: Error without it; for an effect that is not computed, the change that it causes.
        share: The part of the model's operations that it takes.
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
        needed: Lines that request the effects that a scene needs.
        remarks: Further findings, in words.
        done: Part of the work that is done.
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
    needed: list[str] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)
    done: float = 0.0

    def chosen(self, uses: Sequence[Use]) -> list[Point]:
        """Return the points of some uses that were run as a whole."""
        return [p for p in self.points if p.use in uses and not p.how]


Progress = Callable[[Point | Worth], None]
#: A part of a study: its name, the number of results expected of it, and these as they are measured.
Step = tuple[str, int, Iterator[Point | Worth]]


def fill(study: Study, steps: Sequence[Step], progress: Progress) -> None:
    """Take the steps of a study; one that cannot be taken, or to its end, becomes a remark."""
    whole, before = sum(count for _, count, _ in steps), 0
    for name, count, results in steps:
        try:
            for number, result in enumerate(results, 1):
                (study.worth if isinstance(result, Worth) else study.points).append(result)  # type: ignore[arg-type]
                study.done = (before + min(number, count)) / whole
                progress(result)
        except (HybridynError, ImportError) as error:
            study.remarks.append(f"{name}: {error}")
        before += count


def timed(*calls: Callable[[], Any], rounds: int = ROUNDS, threads: int = 1) -> list[float]:
    """Return the least time of each call [s], taken in turn; calls longer than 1 s are not repeated.

    On one core it is processor time, in which a busy machine shows little.
    """
    best, now = [float("inf")] * len(calls), clock.process_time if threads == 1 else clock.perf_counter
    for _ in range(rounds):
        for number, call in enumerate(calls):
            start = now()
            call()
            best[number] = min(best[number], now() - start)
        if max(best) > 1.0:
            break
    return best


def pareto_front(
    items: Iterable[Item], cost: Callable[[Item], float], error: Callable[[Item], float]
) -> list[Item]:
    """Return the items that no other beats in both cost and error, cheapest first."""
    out: list[Item] = []
    for one in sorted(items, key=lambda item: (cost(item), error(item))):
        if error(one) < (error(out[-1]) if out else float("inf")):
            out.append(one)
    return out


def front(points: Iterable[Point], own_error: float = 0.0) -> list[Point]:
    """Return the Pareto front of points that were run as a whole, fastest first.

    A point that saves less than `NOISE` of a more accurate one's time is left out.

    Args:
        points: The points.
        own_error: Error of the reference; errors below it count as equal.
    """
    good = [p for p in points if not p.how]
    kept: list[Point] = []
    for point in reversed(pareto_front(good, lambda p: p.seconds, lambda p: max(p.error, own_error))):
        if not kept or point.seconds * NOISE <= kept[-1].seconds:
            kept.append(point)
    return kept[::-1]


def by_line(points: Iterable[Point]) -> dict[str, list[Point]]:
    """Return the points of each family."""
    lines: dict[str, list[Point]] = {}
    for point in points:
        lines.setdefault(point.line, []).append(point)
    return lines


def fronts(study: Study) -> tuple[list[Point], list[Point]]:
    """Return our own front, and of each engine's method the ends and the middle of its front."""
    own = front(study.chosen(OURS), study.own_error)
    each = [front(line, study.own_error) for line in by_line(study.chosen(("comparison",))).values()]
    return own, [p for line in each for p in dict.fromkeys((line[0], line[len(line) // 2], line[-1]))]


def cheapest(study: Study, target: float, uses: Sequence[Use] = ("usual", "command")) -> Point | None:
    """Return the fastest point within the target, by default of those that a command offers, or None.

    Among equal times it is the most accurate.
    """
    good = [p for p in study.chosen(uses) if p.error <= target]
    if target < study.own_error or not good:
        return None
    least = min(p.seconds for p in good)
    return min((p for p in good if p.seconds <= NOISE * least), key=lambda p: (p.error, p.seconds))


def advice(study: Study, target: float) -> list[str]:
    """Recommend a setting for an error of at most `target` in one sentence, and say what it saves."""
    portion = f"{100 * target:.4g} %" if 1e-5 <= target < 10 else f"{target:.2g}"
    wanted, best = f"For {portion} on {study.subject}", cheapest(study, target)
    if best is None:
        reached = min((p.error for p in study.chosen(OURS)), default=float("inf"))
        least = max(reached, study.own_error)
        return [f"{wanted} no setting that was tried suffices: the least error is {least:.1e}."]
    usual = next((p for p in study.points if p.use == "usual"), best)
    takes = (
        f"It takes {time_words(best.seconds)} {study.time_unit}, with an error of {error_words(best, study)}"
    )
    saves = "nothing cheaper suffices" if best is usual else f"{study.usual}: {_times(usual, best)} as long"
    said = [f"{wanted}, {best.what}.", f"{takes}; {saves}."]
    own = cheapest(study, target, OURS)
    if own is not None and own.use == "program" and best.seconds > NOISE * own.seconds:
        said.append(f"In a program of your own, {own.what}: this takes {_times(own, best)} as long.")
    for one in dict.fromkeys(filter(None, (best, own))):
        if one.elsewhere > target:
            found = f"where its error is {one.elsewhere:.1e}"
            said.append(f"'{one.line}, {one.setting}' does not carry over to {study.second}, {found}.")
    if peer := cheapest(study, target, ("comparison",)):
        words = f"{peer.line}, {peer.setting}".removesuffix(", ")
        said.append(f"The fastest of other engines is {words}: {_times(peer, best)} as long.")
    return said


def _times(one: Point, other: Point) -> str:
    """Write the ratio of the times of two points with two digits; a clock may be too coarse for it."""
    ratio = one.seconds / (other.seconds or one.seconds or 1.0)
    return f"{ratio:.0f} times" if ratio >= 10 else f"{ratio:.2g} times"


def time_words(seconds: float) -> str:
    """Write a time."""
    unit, factor = ("us", 1e6) if seconds < 1e-2 else ("s", 1.0)
    return f"{seconds * factor:.3g} {unit}"


def error_words(point: Point, study: Study) -> str:
    """Write a point's error; an error below that of the reference is shown as "< ..."."""
    least = study.own_error
    return f"< {least:.0e}" if point.error < least else f"{point.error:.1e}"
