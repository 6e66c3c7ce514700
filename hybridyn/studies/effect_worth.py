"""What each effect is worth on a motion: its part of the efforts, its cost in time, what can be left out.

Efforts are linear in every effect but where leg_inertia meets gravity, inertia and velocity. So seven runs of
the inverse model (with and without leg_inertia: gravity; with inertia; with velocity; and once nothing at
all) and one per other effect give the efforts of every set. Only where some of these are impossible, for a
motor that is missing would have to act, other sets are run by themselves.
"""

from __future__ import annotations

import contextlib
import itertools
import time as clock
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property, reduce
from typing import TYPE_CHECKING

import numpy as np

from ..effects.choice import DEFAULT, Effects
from ..errors import ActuationError
from ..spatial import Array
from .sizing import TIE

if TYPE_CHECKING:
    from ..structure.robot import HybridRobot
    from .effect_sets import EffectSets

Names = frozenset[str]

NEEDS_INERTIA = ("velocity", "rotor_inertia")
KEPT = ("payload", "base_motion")
"""Effects that make another robot or another task, and are never weighed."""

LIMITS = "limits"
"""Kept too, for all the effects together: what is left out of a model would not spare a motor."""

NOTHING: Names = frozenset()
GRAVITY: Names = frozenset({"gravity"})
LEGS: Names = frozenset({"leg_inertia"})

TIMED_SAMPLES, ROUNDS = 200, 7


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
        compiled: EffectSets | None = None,
    ) -> None:  # fmt: skip
        """Run the inverse model with all effects; other sets are run where they are asked for.

        Args:
            robot: The robot.
            q: Positions, shape (T, nq).
            v: Rates, shape (T, nv).
            a: Accelerations, shape (T, nv).
            on: The effects, from `choose`.
            wrenches: As `hybridyn.idm` takes them.
            time: Times, shape (T,), or None.
            compiled: Written-out models that give the efforts; they take no wrenches. Times are measured by
                the general path all the same.

        Raises:
            HybridynError: As `hybridyn.idm`, for all the effects together.
        """
        from ..dynamics.in_blocks import efforts_in_blocks

        def general(names: Names, count: int) -> Array:
            outer = {link: W[:count] if np.ndim(W) == 2 else W for link, W in (wrenches or {}).items()}
            at = None if time is None else time[:count]
            moved = q[:count], v[:count], a[:count]
            return efforts_in_blocks(robot, *moved, on.only(names), wrenches=outer, time=at)

        def whole(names: Names) -> Array:
            if compiled is None:
                return general(names, len(q))
            return compiled.idm(q, v, a, on.only(names))

        self.names = tuple(name for name in on.names if name not in (*KEPT, LIMITS))
        self._always = frozenset(on.names) & frozenset(KEPT)
        self._general, self._whole, self._samples = general, whole, len(q)
        self._everything = frozenset(self.names)
        self.full = whole(frozenset(on.names))
        self._basis = self._possible(frozenset(name for name in self.names if name in DEFAULT))
        self._cores: dict[Names, Array | None] = {self._everything: self.full}
        self._additions: dict[str, Array] = {}

    def run(self, names: Names) -> Array:
        """Return the efforts of a set of effects from the inverse model itself, shape (T, motors)."""
        return self._whole(names | self._always)

    def of(self, names: Names) -> Array | None:
        """Return the efforts of a set of effects, shape (T, motors); None where no motor can produce them."""
        if names == self._everything:
            return self.full
        core = self._core(frozenset(name for name in names if name in DEFAULT))
        if core is None:
            return None
        return reduce(np.add, (self._added(name) for name in names if name not in DEFAULT), core)

    def _core(self, names: Names) -> Array | None:
        """Return the efforts of some of the four effects that are not linear in each other."""
        if names not in self._cores:
            self._cores[names] = self._derived(names)
        return self._cores[names]

    def _derived(self, names: Names) -> Array | None:
        """Return the efforts of some of the four: as a difference where that spares a run, or a model."""
        legs = names & LEGS
        if legs and not names - legs:  # they have no weight and do not resist
            return self._core(NOTHING)
        if "gravity" in self.names and "gravity" not in names and "inertia" in names:
            heavy, weight, rest = (self._core(x) for x in (names | GRAVITY, legs | GRAVITY, NOTHING))
            if heavy is not None and weight is not None and rest is not None:
                return heavy - weight + rest
        return self._try(names)

    def _added(self, name: str) -> Array:
        """Return what another effect adds to the efforts; not a number where some motor is missing."""
        if name not in self._additions:
            base, with_it = self._core(self._basis), self._with(name)
            found = np.full_like(self.full, np.nan) if base is None or with_it is None else with_it - base
            self._additions[name] = found
        return self._additions[name]

    def _with(self, name: str) -> Array | None:
        """Return the efforts of the four effects and one more."""
        names = self._basis | {name}
        return self.full if names == self._everything else self._try(names)

    def contributions(self) -> tuple[list[Contribution], float]:
        """Return what each effect adds to the efforts of all the others (inertia: with all that needs it).

        Returns:
            One entry per effect, and the time per sample with all of them [s].
        """
        out = []
        everything = self._everything
        whole = np.sqrt(np.mean(self.full**2, axis=0))
        rests = {name: self._possible(everything - {name}) for name in self.names}
        seconds = self.seconds([everything, *rests.values()])
        for name in self.names:
            without = self.of(rests[name])
            added = np.full_like(self.full, np.nan) if without is None else self.full - without
            peak = _peaks(added)
            rms = np.sqrt(np.mean(added**2, axis=0))
            share = np.divide(rms, whole, out=np.zeros_like(rms), where=whole > 0)
            cost = seconds[everything] - seconds.get(rests[name], 0.0)
            out.append(Contribution(name, peak, rms, share, max(cost, 0.0)))
        return out, seconds[everything]

    def cheapest(self, within: float) -> Selection:
        """Return the fastest set of effects whose efforts stay near those of all of them.

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
        efforts = self.of(names)
        assert efforts is not None
        deviation, motor = _departure(efforts - self.full, peaks)
        ordered = tuple(name for name in self.names if name in names)
        seconds = self.seconds([names, self._everything])
        return Selection(ordered, deviation, motor, seconds[names], seconds[self._everything])

    def seconds(self, sets: Iterable[Names]) -> dict[Names, float]:
        """Measure the time per sample [s] that sets of effects take by the general path.

        Returns:
            The best of a few rounds through all sets, but those that no motor can produce.
        """
        samples = min(TIMED_SAMPLES, self._samples)
        best: dict[Names, float] = {}
        for names in dict.fromkeys(sets):
            with contextlib.suppress(ActuationError):
                self._general(names | self._always, samples)
                best[names] = np.inf
        for names in list(best) * ROUNDS:
            started = clock.perf_counter()
            self._general(names | self._always, samples)
            best[names] = min(best[names], clock.perf_counter() - started)
        return {names: float(value) / max(samples, 1) for names, value in best.items()}

    def _priced(self, names: Names) -> float:
        """Return the time of a set from those of its parts [s]."""
        cores, extra = self._prices
        core = frozenset(name for name in names if name in DEFAULT)
        return cores.get(core, np.inf) + sum(extra[name] for name in names if name in extra)

    @cached_property
    def _prices(self) -> tuple[dict[Names, float], dict[str, float]]:
        """Time of each subset of the four, and what every other effect adds [s]."""
        base, others = self._basis, [name for name in self.names if name not in DEFAULT]
        four = [name for name in self.names if name in DEFAULT]
        cores = [names for names in subsets(four) if names == self._possible(names)]
        times = self.seconds([*cores, *(base | {name} for name in others)])
        whole = times.get(base, 0.0)
        extra = {name: max(times.get(base | {name}, np.inf) - whole, 0.0) for name in others}
        return {core: times[core] for core in cores if core in times}, extra

    def _possible(self, names: Names) -> Names:
        """Take out of a set what cannot be without inertia."""
        return names if "inertia" in names else names - frozenset(NEEDS_INERTIA)

    def _try(self, names: Names) -> Array | None:
        """Return the efforts of a set of effects, None where a passive motion would need one."""
        try:
            return self.run(names)
        except ActuationError:
            return None


def subsets(names: list[str] | tuple[str, ...]) -> list[Names]:
    """Give every subset of some names."""
    return [frozenset(chosen) for n in range(len(names) + 1) for chosen in itertools.combinations(names, n)]


def _peaks(added: Array) -> Array:
    """Return each motor's largest value, with its sign; of equal ones the first."""
    size = np.abs(added)
    first = np.argmax(~(size < size.max(axis=0, initial=0.0) * (1 - TIE)), axis=0)
    return np.asarray(np.take_along_axis(added, first[None], axis=0)[0])


def _departure(error: Array, peaks: Array) -> tuple[float, int]:
    """Give the largest error over a motor's peak effort, and the motor; an idle motor's error is infinite."""
    largest = np.abs(error).max(axis=0, initial=0.0)
    part = np.where(largest > 0, np.inf, 0.0)
    np.divide(largest, peaks, out=part, where=peaks > 0)
    motor = int(np.argmax(part)) if len(part) else 0
    return (float(part[motor]) if len(part) else 0.0), motor
