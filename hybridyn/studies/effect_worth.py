"""Contribution of each effect to the efforts of a motion, its computing time, and which can be omitted.

The inverse model is run separately for each set of effects: all of them, all but one, and the sets that
`Worth.sufficient` tries.
"""

from __future__ import annotations

import time as clock
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..effects.choice import Effects
from ..errors import ActuationError, HybridynError
from ..spatial import Array
from ..tables.over_time import Peaks, rms_over

if TYPE_CHECKING:
    from ..compiled.model import CompiledRobot
    from ..structure.robot import HybridRobot

Names = frozenset[str]

NEEDS_INERTIA: Names = frozenset({"velocity", "rotor_inertia"})

#: Effects that define another robot or another task. They stay as chosen and are never evaluated; nor are
#: the limits, which combine all effects.
KEPT: Names = frozenset({"payload", "base_motion"})
LIMITS = "limits"

TIMED_SAMPLES, ROUNDS = 200, 7


@dataclass(frozen=True, eq=False)
class Contribution:
    """Contribution of one effect to the efforts.

    Attributes:
        name: Name of the effect.
        peak: Largest contribution per motor by magnitude, with its sign, shape (motors,), [N or N m]; nan
            where a passive motion would need an effort without the effect.
        rms: RMS contribution per motor, shape (motors,), [N or N m].
        share: RMS contribution over the RMS of the full effort, shape (motors,). Shares need not sum to one.
        seconds: Computing time of the effect per sample [s].
    """

    name: str
    peak: Array
    rms: Array
    share: Array
    seconds: float


@dataclass(frozen=True)
class Selection:
    """A set of effects that is accurate enough.

    Attributes:
        names: The effects.
        deviation: Largest deviation from the full effort, relative to the motor's peak full effort.
        motor: Number of the motor with the largest deviation.
        seconds: Time per sample [s].
        full_seconds: Time per sample with every effect [s].
    """

    names: tuple[str, ...]
    deviation: float
    motor: int
    seconds: float
    full_seconds: float


class EffectSets:
    """Compiled models of one robot, each compiled when its set of effects is first requested.

    Attributes:
        models: The models, by the names of their effects.
        refused: The error message of each set that could not be compiled, by the names of its effects. The
            general path computes these sets.
    """

    def __init__(self, whole: CompiledRobot) -> None:
        """Start with the model of all effects that can be requested."""
        self._robot, self.models = whole.robot, {whole.effects.names: whole}
        self.refused: dict[tuple[str, ...], str] = {}

    def model(self, on: Effects) -> CompiledRobot | None:
        """Return the model of a set of effects, or None if it cannot be generated, built or verified."""
        from ..compiled.compiling import compile

        if on.names not in self.models and on.names not in self.refused:
            try:
                self.models[on.names] = compile(self._robot, on)
            except HybridynError as error:  # e.g. no direct model to verify it against
                error.sample = None  # it is random
                self.refused[on.names] = str(error)
        return self.models.get(on.names)


class Worth:
    """The efforts of a motion under sets of effects.

    Attributes:
        names: The effects that are evaluated.
        full: Efforts with all of them, shape (T, motors).
    """

    def __init__(
        self, robot: HybridRobot, q: Array, v: Array, a: Array, on: Effects, *,
        wrenches: Mapping[str, Array] | None = None, time: Array | None = None,
        compiled: EffectSets | None = None,
    ) -> None:  # fmt: skip
        """Run the inverse model with all effects; other sets are run on request.

        Args:
            q: Positions, shape (T, nq).
            v: Rates, shape (T, nv).
            a: Accelerations, shape (T, nv).
            on: The effects, from `choose`.
            wrenches: As `hybridyn.idm` takes them.
            time: Times, shape (T,), or None.
            compiled: Compiled models that compute the efforts; they accept no wrenches. Times are still
                measured with the general path.

        Raises:
            HybridynError: As `hybridyn.idm`, with all effects on.
        """
        self._robot, self._motion, self._on, self._compiled = robot, (q, v, a), on, compiled
        self._wrenches, self._time = wrenches or {}, time
        self.names = tuple(name for name in on.names if name not in KEPT | {LIMITS})
        self.full = self.run(frozenset(on.names))
        self._found: dict[Names, Array | None] = {frozenset(self.names): self.full}
        self._peaks = np.abs(self.full).max(axis=0, initial=0.0)

    def run(self, names: Names) -> Array:
        """Compute the efforts with a set of effects, shape (T, motors), [N or N m].

        Raises:
            ActuationError: A passive motion would need an effort.
        """
        on = self._on.only(names | KEPT)
        model = None if self._compiled is None else self._compiled.model(on)
        if model is None:
            return self._general(on)
        return model.idm(*self._motion)

    def contributions(self) -> tuple[list[Contribution], float]:
        """Compute the difference that each effect makes; inertia is removed with the effects that need it.

        Returns:
            One entry per effect, and the time per sample with all effects [s].
        """
        everything, out = frozenset(self.names), []
        whole = rms_over(self._time, self.full)
        rests = {name: without(everything, name) for name in self.names}
        seconds = self._seconds([everything, *rests.values()])
        for name, rest in rests.items():
            left = self._efforts(rest)
            added = np.full_like(self.full, np.nan) if left is None else self.full - left
            rms = rms_over(self._time, added)
            peaks = Peaks(added.shape[1])
            peaks.add(added, np.arange(len(added), dtype=float))
            share = np.divide(rms, whole, out=np.zeros_like(rms), where=whole > 0)
            cost = max(seconds[everything] - seconds.get(rest, 0.0), 0.0)
            out.append(Contribution(name, peaks.value, rms, share, cost))
        return out, seconds[everything]

    def sufficient(self, within: float) -> Selection:
        """Remove effects one by one, the smallest contribution first, while the efforts stay accurate.

        Args:
            within: Largest deviation from the full effort, relative to that motor's peak full effort.
        """
        everything = names = frozenset(self.names)
        departure, motor = self._departure(names)
        for name in sorted(self.names, key=lambda name: self._departure(without(everything, name))[0]):
            further = self._departure(without(names, name))
            if further[0] <= within:
                names, (departure, motor) = without(names, name), further
        seconds = self._seconds([names, everything])
        ordered = tuple(name for name in self.names if name in names)
        return Selection(ordered, departure, motor, seconds[names], seconds[everything])

    def _efforts(self, names: Names) -> Array | None:
        """Return the efforts with a set of effects, or None if a passive motion would need an effort."""
        if names not in self._found:
            try:
                self._found[names] = self.run(names)
            except ActuationError:
                self._found[names] = None
        return self._found[names]

    def _departure(self, names: Names) -> tuple[float, int]:
        """Compute the largest error over a motor's peak effort (inf for an idle motor), and the motor."""
        efforts = self._efforts(names)
        if efforts is None:
            return np.inf, 0
        largest = np.abs(efforts - self.full).max(axis=0, initial=0.0)
        part = np.where(largest > 0, np.inf, 0.0)
        np.divide(largest, self._peaks, out=part, where=self._peaks > 0)
        motor = int(np.argmax(part)) if len(part) else 0
        return (float(part[motor]) if len(part) else 0.0), motor

    def _seconds(self, sets: list[Names]) -> dict[Names, float]:
        """Measure the least time per sample [s] of each feasible set of effects with the general path."""
        samples = min(TIMED_SAMPLES, len(self.full))
        best = {names: np.inf for names in sets if self._efforts(names) is not None}
        for names in list(best) * ROUNDS:
            started = clock.perf_counter()
            self._general(self._on.only(names | KEPT), samples)
            best[names] = min(best[names], clock.perf_counter() - started)
        return {names: value / max(samples, 1) for names, value in best.items()}

    def _general(self, on: Effects, count: int | None = None) -> Array:
        """Compute the efforts of all samples, or of the first `count`, with the general path."""
        from ..streams.efforts import efforts_in_blocks

        q, v, a = (x[:count] for x in self._motion)
        outer = {link: W[:count] if np.ndim(W) == 2 else W for link, W in self._wrenches.items()}
        time = None if self._time is None else self._time[:count]
        return efforts_in_blocks(self._robot, q, v, a, on, wrenches=outer, time=time)


def without(names: Names, name: str) -> Names:
    """Return a set of effects without one effect and without those that need it."""
    return names - {name} - (NEEDS_INERTIA if name == "inertia" else frozenset())
