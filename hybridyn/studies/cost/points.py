"""Measured settings: error against time, the Pareto front, and the cheapest setting for a given error."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple, TypeVar

from ...errors import HybridynError

#: What is computed along a trajectory, the usual quantity first, and what has the errors.
QUANTITIES = {
    "idm": "motor efforts",
    "ddm": "accelerations",
    "close": "the motion of all joints from the motors'",
    "designs": "motor efforts of designs with another mass",
    "idm_jacobian": "derivatives of motor efforts over the motors' motion",
    "ddm_jacobian": "derivatives of the motors' accelerations over their motion and efforts",
}

#: The error that an advice is about where none is asked for.
ADVISED = 1e-3

#: Time that the runs of a scene take at most [s], but for one that is under way and for building C.
SECONDS = 30.0

#: Most measurements of a time, and how long they take together [s]. The least is used, since disturbances
#: only make a computation slower.
ROUNDS, LONG = 50, 0.5

#: Times within this factor count as equal; the more accurate configuration is then chosen.
NOISE = 1.05

#: Speed of the second motion, relative to the first, and the second motion by the unit of times, in words.
SLOWER = 0.7
SECOND = {
    "per sample": f"the same path at {SLOWER:g} times the speed",
    "per run": f"a motion that begins where this one ends, at {SLOWER:g} times the rates",
}

Use = Literal["usual", "command", "program", "comparison"]
#: Uses of our own settings.
OURS: tuple[Use, ...] = ("usual", "command", "program")

Item = TypeVar("Item")


@dataclass(frozen=True)
class CostPoint:
    """One setting.

    Attributes:
        line: Family that it belongs to: one line of the plot.
        setting: What distinguishes it within its family, in words.
        error: Relative error (see `CostStudy`); infinite where it is not known.
        seconds: Time per sample or of the whole run [s].
        fragment: Lines to paste into a scene, or comments if no scene can request it.
        use: "usual" for the default, "command" if a command offers it, "program" if only a program of your
            own can use it, "comparison" if it is for comparison only.
        what: How to obtain it, in words that continue "For 0.1 %, ...".
        one_call: Whether it is the time of one sample at a time; else that of a batch or a run.
        elsewhere: Error on the motion `SECOND`; nan if there is none.
        path: Of a run, the largest error at any of many times; nan if there is none, as below.
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
        share: The part of the model's operations that it takes, or of its time, as `share_left_out` says.
        computed: Whether the motion's model or the scene computes it.
    """

    effect: str
    error: float
    share: float
    computed: bool


@dataclass(eq=False)
class CostStudy:
    """All settings of one question, as far as they have been measured.

    Attributes:
        question: Definition of error and time, in words.
        time_unit: "per sample" or "per run".
        subject: The quantity that has the errors: "motor efforts" or "the last posture".
        reference: The reference of the errors, in words.
        own_error: Relative error of the reference; smaller errors of points are not known.
        points: The settings.
        worth: What each effect is worth.
        kept: The effects that a scene needs.
        needed: Lines that request them.
        remarks: Further findings, in words.
        done: Part of the work that is done.
    """

    question: str
    time_unit: str
    subject: str = "motor efforts"
    reference: str = ""
    own_error: float = 0.0
    points: list[CostPoint] = field(default_factory=list)
    worth: list[Worth] = field(default_factory=list)
    kept: list[str] = field(default_factory=list)
    needed: list[str] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)
    done: float = 0.0

    def chosen(self, uses: Sequence[Use]) -> list[CostPoint]:
        """Return the points of some uses that were run as a whole."""
        return [p for p in self.points if p.use in uses and not p.how]


Progress = Callable[[CostPoint | Worth], None]
#: A part of a study: its name, and its results as they are measured.
Step = tuple[str, Iterator[CostPoint | Worth]]


def fill(study: CostStudy, steps: Sequence[Step], progress: Progress) -> None:
    """Take the steps of a study; one that cannot be taken, or to its end, becomes a remark."""
    for number, (name, results) in enumerate(steps, 1):
        try:
            for result in results:
                (study.worth if isinstance(result, Worth) else study.points).append(result)  # type: ignore[arg-type]
                study.done = number / len(steps)
                progress(result)
        except (HybridynError, ImportError) as error:
            study.remarks.append(f"{name}: {error}")


def timed(*calls: Callable[[], Any], threads: int = 1) -> list[float]:
    """Return the least time of each call [s], taken in turn for `LONG`, or `ROUNDS` times.

    On one core it is processor time, in which a busy machine shows little.
    """
    best, now = [float("inf")] * len(calls), clock.process_time if threads == 1 else clock.perf_counter
    end = now() + LONG
    for _ in range(ROUNDS):
        for number, call in enumerate(calls):
            start = now()
            call()
            best[number] = min(best[number], now() - start)
        if now() >= end:
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


def front(points: Iterable[CostPoint], own_error: float = 0.0) -> list[CostPoint]:
    """Return the Pareto front of points that were run as a whole, fastest first.

    A point that saves less than `NOISE` of the next more accurate one's time is left out.

    Args:
        own_error: Error of the reference; errors below it count as equal.
    """
    good = (p for p in points if not p.how)
    best = pareto_front(good, lambda p: p.seconds, lambda p: max(p.error, own_error))
    following = [*(p.seconds for p in best[1:]), float("inf")]
    return [p for p, after in zip(best, following, strict=False) if p.seconds * NOISE <= after]


def by_line(points: Sequence[CostPoint]) -> dict[str, list[CostPoint]]:
    """Return the points of each family."""
    return {line: [p for p in points if p.line == line] for line in {p.line: 0 for p in points}}


def cheapest(study: CostStudy, target: float, uses: Sequence[Use] = ("usual", "command")) -> CostPoint | None:
    """Return the fastest point within the target, by default of those that a command offers, or None.

    Among equal times it is the most accurate.
    """
    good = [p for p in study.chosen(uses) if p.error <= target >= study.own_error]
    least = min((p.seconds for p in good), default=0.0)
    return min((p for p in good if p.seconds <= NOISE * least), key=lambda p: p.error, default=None)


def advice(study: CostStudy, target: float) -> list[str]:
    """Recommend a setting for an error of at most `target` in one sentence, and say what others take."""
    portion = f"{100 * target:.4g} %" if 1e-5 <= target < 10 else f"{target:.2g}"
    wanted, best = f"For {portion} on {study.subject}", cheapest(study, target)
    if best is None:
        reached = min((p.error for p in study.chosen(OURS)), default=float("inf"))
        least = max(reached, study.own_error)
        return [f"{wanted} no setting that was tried suffices: the least error is {least:.1e}."]
    own, peer = cheapest(study, target, OURS) or best, cheapest(study, target, ("comparison",))
    others = {
        "what is usual": next((p for p in study.points if p.use == "usual"), None),
        f"in a program of your own, {own.what}": own,
        f"the fastest of other engines, {peer and ', '.join(filter(None, (peer.line, peer.setting)))}": peer,
    }
    takes, error = time_words(best.seconds), error_words(best, study)
    said = [f"{wanted}, {best.what}.", f"It takes {takes} {study.time_unit}, with an error of {error}."]
    for words, other in others.items():
        if other and other is not best:
            ratio = other.seconds / (best.seconds or other.seconds or 1.0)
            said.append(f"{words[0].upper()}{words[1:]}: {float(f'{ratio:.2g}'):g} times as long.")
    return said + [
        f"'{p.line}, {p.setting}' does not carry over to {SECOND[study.time_unit]}, "
        f"where its error is {p.elsewhere:.1e}."
        for p in dict.fromkeys((best, own))
        if p.elsewhere > target
    ]


def time_words(seconds: float) -> str:
    """Write a time."""
    unit, factor = ("us", 1e6) if seconds < 1e-2 else ("s", 1.0)
    return f"{seconds * factor:.3g} {unit}"


def error_words(point: CostPoint, study: CostStudy) -> str:
    """Write a point's error; one below that of the reference as "< ...", one of no complete run in words."""
    least = study.own_error
    if point.error == float("inf"):
        return "not known"
    return f"< {least:.0e}" if point.error < least else f"{point.error:.1e}"
