"""Contribution of each effect to the efforts of a motion.

The inverse model is run with all effects, and with all but one. What effects cost in time, and which a target
allows to leave out, is the business of `cost`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..effects.choice import Effects
from ..effects.words import BOUNDS
from ..errors import ActuationError, HybridynError
from ..spatial import Array
from ..tables.over_time import Peaks, rms_over

if TYPE_CHECKING:
    from ..compiled import CompiledRobot
    from ..structure.robot import HybridRobot

NEEDS_INERTIA = frozenset({"velocity", "rotor_inertia"})

#: Effects that define another robot or another task. They stay as chosen and are never evaluated; nor are
#: bounds of motors, which combine all effects.
KEPT = frozenset({"payload", "base_motion", "massless_legs"})


@dataclass(frozen=True, eq=False)
class Contribution:
    """Contribution of one effect to the efforts.

    Attributes:
        name: Name of the effect.
        peak: Largest contribution per motor by magnitude, with its sign, shape (motors,), [N or N m]; nan
            where a passive motion would need an effort without the effect.
        rms: RMS contribution per motor, shape (motors,), [N or N m].
        share: RMS contribution over the RMS of the full effort, shape (motors,). Shares need not sum to one.
    """

    name: str
    peak: Array
    rms: Array
    share: Array


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
        from ..compiled import compile

        if on.names not in self.models and on.names not in self.refused:
            try:
                self.models[on.names] = compile(self._robot, on)
            except HybridynError as error:  # e.g. no direct model to verify it against
                error.sample = None  # it is random
                self.refused[on.names] = str(error)
        return self.models.get(on.names)


def contributions(
    robot: HybridRobot, q: Array, v: Array, a: Array, on: Effects, *,
    wrenches: Mapping[str, Array] | None = None, time: Array | None = None, sets: EffectSets | None = None,
) -> list[Contribution]:  # fmt: skip
    """Compute the difference that each effect makes; inertia is left out with the effects that need it.

    Args:
        q: Positions, shape (T, nq).
        v: Rates, shape (T, nv).
        a: Accelerations, shape (T, nv).
        on: The effects, from `choose`.
        wrenches: As `hybridyn.idm` takes them.
        time: Times, shape (T,), or None.
        sets: Compiled models, which accept no wrenches.

    Raises:
        HybridynError: As `hybridyn.idm`, with all effects on.
    """
    from ..streams.one_pass import efforts_in_blocks

    def efforts(wanted: Effects) -> Array:
        """Compute the efforts with a set of effects, shape (T, motors), [N or N m]."""
        if sets is not None and (model := sets.model(wanted)) is not None:
            return model.idm(q, v, a)
        return efforts_in_blocks(robot, q, v, a, wanted, wrenches=wrenches, time=time)

    full, out = efforts(on), []
    whole = rms_over(time, full)
    every = [name for name in on.names if name not in KEPT.union(BOUNDS)]
    for name in every:
        rest = {*every, *KEPT} - {name} - (NEEDS_INERTIA if name == "inertia" else set())
        try:
            added = full - efforts(on.only(rest))
        except ActuationError:
            added = np.full_like(full, np.nan)
        rms, peaks = rms_over(time, added), Peaks(added.shape[1])
        peaks.add(added, np.arange(len(added), dtype=float))
        share = np.divide(rms, whole, out=np.zeros_like(rms), where=whole > 0)
        out.append(Contribution(name, peaks.value, rms, share))
    return out
