"""What each effect is worth on a motion: its part of the efforts, its cost in time, what can be left out.

Efforts are linear in every effect but where leg_inertia meets gravity, inertia and velocity. So twelve runs
of the inverse model (the subsets of these four) and one per other effect give the efforts of every set.
"""

from __future__ import annotations

import itertools
import time as clock
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..errors import ActuationError
from ..spatial import Array
from .choice import DEFAULT, Effects

if TYPE_CHECKING:
    from ..robot import HybridRobot

NEEDS_INERTIA = ("velocity", "rotor_inertia")
KEPT = ("payload", "base_motion", "limits")
"""Effects that make another robot or another task, and are never weighed."""

TIMED_SAMPLES, ROUNDS = 200, 7

Names = frozenset[str]


@dataclass(frozen=True)
class Contribution:
    """What one effect adds to the efforts.

    Attributes:
        name: Name of the effect.
        peak: Largest addition by motor, with its sign, shape (motors,), [N or N m].
        rms: Its root mean square, shape (motors,).
        share: RMS over the RMS of the whole effort, shape (motors,); shares need not sum to one.
        seconds: Time that it costs per sample [s].
    """

    name: str
    peak: Array
    rms: Array
    share: Array
    seconds: float


@dataclass(frozen=True)
class Selection:
    """A set of effects that is good enough.

    Attributes:
        names: The effects.
        deviation: Largest departure of an effort from the full one, over the motor's peak full effort.
        motor: Number of the motor where that is.
        seconds: Time per sample [s].
        full_seconds: Time per sample with every effect [s].
    """

    names: tuple[str, ...]
    deviation: float
    motor: int
    seconds: float
    full_seconds: float


class Worth:
    """The efforts of a motion under every set of effects.

    Attributes:
        names: The effects that are weighed.
        full: Efforts with all of them, shape (T, motors).
    """

    def __init__(
        self, robot: HybridRobot, q: Array, v: Array, a: Array, on: Effects, *,
        wrenches: Mapping[str, Array] | None = None, time: Array | None = None,
    ) -> None:  # fmt: skip
        """Run the inverse model as often as needed.

        Args:
            robot: The robot.
            q: Positions, shape (T, nq).
            v: Rates, shape (T, nv).
            a: Accelerations, shape (T, nv).
            on: The effects, from `choose`.
            wrenches: As `hybridyn.idm` takes them.
            time: Times, shape (T,), or None.

        Raises:
            HybridynError: As `hybridyn.idm`, for all the effects together.
        """
        from ..idm import idm

        def efforts(names: Names, samples: slice) -> Array:
            outer = {link: W[samples] if np.ndim(W) == 2 else W for link, W in (wrenches or {}).items()}
            at = None if time is None else time[samples]
            return idm(
                robot, q[samples], v[samples], a[samples], wrenches=outer, time=at, effects=on.only(names)
            )

        self.names = tuple(name for name in on.names if name not in KEPT)
        self._always = frozenset(on.names) & frozenset(KEPT)
        self._efforts, self._samples = efforts, len(q)
        self.full = self.run(frozenset(self.names))
        core = [name for name in self.names if name in DEFAULT]
        everything = self._possible(frozenset(core))
        self._core = {names: self._try(names) for names in subsets(core) if names == self._possible(names)}
        base = self._core[everything]
        self._added: dict[str, Array] = {}
        for name in self.names:
            if name in core:
                continue
            with_it = self._try(everything | {name})
            self._added[name] = (
                np.full_like(self.full, np.nan) if base is None or with_it is None else with_it - base
            )

    def run(self, names: Names) -> Array:
        """Give the efforts of a set of effects from the inverse model itself, shape (T, motors)."""
        return self._efforts(names | self._always, slice(None))

    def of(self, names: Names) -> Array | None:
        """Give the efforts of a set of effects, shape (T, motors); None where no motor can produce them."""
        core = self._core[frozenset(name for name in names if name in DEFAULT)]
        if core is None:
            return None
        return core + sum((self._added[name] for name in names if name in self._added), start=np.zeros(()))

    def contributions(self) -> tuple[list[Contribution], float]:
        """Give what each effect adds to the efforts of all the others (inertia: with all that needs it).

        Returns:
            One entry per effect, and the time per sample with all of them [s].
        """
        out = []
        everything = frozenset(self.names)
        whole = np.sqrt(np.mean(self.full**2, axis=0))
        rests = {name: self._possible(everything - {name}) for name in self.names}
        runs = [rest for rest in rests.values() if self._try(rest) is not None]
        seconds = self.seconds([everything, *runs])
        for name in self.names:
            without = self.of(rests[name])
            added = np.full_like(self.full, np.nan) if without is None else self.full - without
            peak = np.take_along_axis(added, np.argmax(np.abs(added), axis=0)[None], axis=0)[0]
            rms = np.sqrt(np.mean(added**2, axis=0))
            share = np.divide(rms, whole, out=np.zeros_like(rms), where=whole > 0)
            cost = seconds[everything] - seconds.get(rests[name], 0.0)
            out.append(Contribution(name, peak, rms, share, max(cost, 0.0)))
        return out, seconds[everything]

    def cheapest(self, within: float) -> Selection:
        """Give the fastest set of effects whose efforts stay near those of all of them.

        Args:
            within: Largest departure from the full effort, as a part of that motor's peak effort.
        """
        peaks = np.abs(self.full).max(axis=0, initial=0.0)
        good: list[tuple[float, int, Names]] = []
        for names in subsets(self.names):
            if names != self._possible(names):
                continue
            efforts = self.of(names)
            if efforts is None or not _departure(efforts - self.full, peaks)[0] <= within:
                continue
            good.append((self._priced(names), len(names), names))
        names = min(good, key=lambda entry: entry[:2])[2] if good else frozenset(self.names)
        deviation, motor = _departure(self.run(names) - self.full, peaks)
        ordered = tuple(name for name in self.names if name in names)
        everything = frozenset(self.names)
        seconds = self.seconds([names, everything])
        return Selection(ordered, deviation, motor, seconds[names], seconds[everything])

    def seconds(self, sets: Iterable[Names]) -> dict[Names, float]:
        """Measure the time that sets of effects take per sample [s]: the best of a few rounds through all."""
        samples = slice(0, min(TIMED_SAMPLES, self._samples))
        best = dict.fromkeys(sets, np.inf)
        for names in list(best) * ROUNDS:
            started = clock.perf_counter()
            self._efforts(names | self._always, samples)
            best[names] = min(best[names], clock.perf_counter() - started)
        return {names: float(value) / max(samples.stop, 1) for names, value in best.items()}

    def _priced(self, names: Names) -> float:
        """Give the time of a set from those of its parts [s]."""
        cores, extra = self._prices
        core = frozenset(name for name in names if name in DEFAULT)
        return cores[core] + sum(extra[name] for name in names if name in extra)

    @cached_property
    def _prices(self) -> tuple[dict[Names, float], dict[str, float]]:
        """Time of each subset of the four, and what every other effect adds [s]."""
        base = self._possible(frozenset(name for name in self.names if name in DEFAULT))
        cores = [core for core, efforts in self._core.items() if efforts is not None]
        times = self.seconds([*cores, *(base | {name} for name in self._added)])
        extra = {name: max(times[base | {name}] - times[base], 0.0) for name in self._added}
        return {core: times[core] for core in cores}, extra

    def _possible(self, names: Names) -> Names:
        """Take out of a set what cannot be without inertia."""
        return names if "inertia" in names else names - frozenset(NEEDS_INERTIA)

    def _try(self, names: Names) -> Array | None:
        """Give the efforts of a set of effects, None where a passive motion would need one."""
        try:
            return self.run(names)
        except ActuationError:
            return None


def subsets(names: list[str] | tuple[str, ...]) -> list[Names]:
    """Give every subset of some names."""
    return [frozenset(chosen) for n in range(len(names) + 1) for chosen in itertools.combinations(names, n)]


def _departure(error: Array, peaks: Array) -> tuple[float, int]:
    """Give the largest error over a motor's peak effort, and the motor; an idle motor's error is infinite."""
    largest = np.abs(error).max(axis=0, initial=0.0)
    part = np.where(largest > 0, np.inf, 0.0)
    np.divide(largest, peaks, out=part, where=peaks > 0)
    motor = int(np.argmax(part)) if len(part) else 0
    return (float(part[motor]) if len(part) else 0.0), motor
